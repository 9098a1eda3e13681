// Keeps an open page up to date: the server says when something changed.
"use strict";
(() => {
  const root = document.querySelector("[data-follow]");
  if (!root) return;
  const status = document.getElementById("followed");
  const live = document.querySelectorAll("[data-live]").length > 0;
  let seen = root.dataset.seen;
  let wanted = seen;
  let busy = false;

  const refresh = async () => {
    if (busy || wanted === seen) return;
    busy = true;
    const now = wanted;
    try {
      if (!live) {
        location.reload();
        return;
      }
      const answer = await fetch(location.pathname, { cache: "no-store" });
      if (!answer.ok) throw new Error(answer.status);
      const fresh = new DOMParser().parseFromString(await answer.text(), "text/html");
      for (const part of document.querySelectorAll("[data-live]")) replace(part, fresh);
      for (const part of document.querySelectorAll("[data-while]")) { // what is not due any more
        if (!fresh.getElementById(part.id)) part.remove();
      }
      seen = now;
      status.textContent = "";
    } catch {
      status.textContent = root.dataset.lost;
    }
    setTimeout(() => { busy = false; refresh(); }, 1000); // at most once a second
  };

  // What a person has open or focused stays as it is.
  const replace = (part, fresh) => {
    const other = fresh.getElementById(part.id);
    if (!other || other.innerHTML === part.innerHTML) return;
    if (part.querySelector("details[open]")) return;
    const focused = part.contains(document.activeElement) ? document.activeElement.id : "";
    part.replaceChildren(...other.childNodes);
    if (focused) document.getElementById(focused)?.focus();
  };

  const source = new EventSource(root.dataset.follow);
  source.onmessage = (event) => { wanted = event.data; status.textContent = ""; refresh(); };
  source.onerror = () => {
    const ended = source.readyState === EventSource.CLOSED; // refused: it does not try again
    status.textContent = ended ? root.dataset.ended : root.dataset.lost;
    if (ended && !live) setTimeout(() => location.reload(), 10000);
  };
  addEventListener("offline", () => { status.textContent = root.dataset.lost; });
  addEventListener("online", () => { status.textContent = ""; });
  addEventListener("pagehide", () => source.close());
  addEventListener("pageshow", (event) => { if (event.persisted) location.reload(); });
})();
