// Sends each answer as it is given. Without this script the form's button sends all of them.
"use strict";
(() => {
  // The back button shows the page as it is now, not as it was.
  addEventListener("pageshow", (event) => { if (event.persisted) location.reload(); });

  const form = document.querySelector("form[data-save]");
  if (!form) return;
  const said = document.getElementById("saved");
  const answered = document.getElementById("answered");
  const waiting = new Map(); // item -> newest value that is not saved yet
  let sending = false;
  let pause = 0;
  let timer = 0;

  const question = (input) => input.closest("[data-item]");
  const mark = (box, text) => {
    box.classList.toggle("marked", text !== "");
    box.querySelector(".mark").textContent = text;
    const entry = box.querySelector("input[type=text], textarea");
    if (text) entry?.setAttribute("aria-invalid", "true");
    else entry?.removeAttribute("aria-invalid");
  };
  const given = (box) => box.querySelector("input:checked")?.value ??
    box.querySelector("input[type=text], textarea")?.value.trim() ?? "";
  // What depends on a question stands after it. The server decides by the same rule.
  const show = () => {
    for (const box of form.querySelectorAll("[data-shown-if]")) {
      const asked = form.querySelector(`[data-item="${box.dataset.shownIf}"]`);
      const answer = given(asked);
      box.hidden = asked.hidden || !JSON.parse(box.dataset.shownAfter).some((one) =>
        typeof one === "number" ? answer !== "" && Number(answer) === one : answer === one);
    }
    const shown = [...form.querySelectorAll("[data-item]:not([hidden])")];
    shown.forEach((box, index) => { box.querySelector(".number").textContent = index + 1; });
    form.elements.seen.value = shown.map((box) => box.dataset.item).join(" ");
  };
  const count = () => {
    const boxes = [...form.querySelectorAll("[data-item]:not([hidden])")];
    const done = boxes.filter((box) => given(box) !== "").length;
    answered.textContent = form.dataset.answered
      .replace("{answered}", done).replace("{items}", boxes.length) + ".";
  };
  const body = (item, value) =>
    new URLSearchParams({ csrf: form.elements.csrf.value, item, value });

  const send = async () => {
    clearTimeout(timer);
    if (sending || waiting.size === 0) return;
    sending = true;
    said.textContent = form.dataset.saving;
    const [item, value] = waiting.entries().next().value;
    let answer = null;
    try {
      answer = await fetch(form.dataset.save, { method: "POST", body: body(item, value) });
    } catch {
      // no connection: tried again below
    }
    sending = false;
    if (answer === null || answer.status >= 500 || answer.status === 429) {
      pause = Math.min(10000, pause ? 2 * pause : 500);
      said.textContent = form.dataset.unsaved;
      timer = setTimeout(send, pause);
      return;
    }
    pause = 0;
    const newest = waiting.get(item) === value;
    if (newest) waiting.delete(item);
    if (answer.status === 422) {
      const text = await answer.text();
      if (newest) mark(form.querySelector(`[data-item="${item}"]`), text);
      said.textContent = "";
    } else if (!answer.ok) {
      waiting.clear();
      said.textContent = form.dataset.cannot;
      return;
    } else if (waiting.size === 0) {
      said.textContent = form.dataset.saved;
    }
    send();
  };

  const keep = (input, wait) => {
    const box = question(input);
    if (!box) return;
    mark(box, "");
    show();
    if (!form.querySelector(".marked:not([hidden])")) document.getElementById("missing")?.remove();
    waiting.delete(box.dataset.item);
    waiting.set(box.dataset.item, input.value);
    count();
    if (pause) return; // a retry is due anyway
    clearTimeout(timer);
    timer = setTimeout(send, wait);
  };
  form.addEventListener("change", (event) => keep(event.target, 0));
  form.addEventListener("input", (event) => {
    if (event.target.type !== "radio") keep(event.target, 600);
  });
  form.addEventListener("submit", (event) => {
    if (form.dataset.sent) { event.preventDefault(); return; } // pressed twice
    form.dataset.sent = "yes";
    clearTimeout(timer);
    waiting.clear(); // the form holds them all
  });
  addEventListener("pagehide", () => {
    for (const [item, value] of waiting) {
      fetch(form.dataset.save, { method: "POST", body: body(item, value), keepalive: true });
    }
  });
  show();
  count();
})();
