"""A real console as a process, and what the browsers of a participant and of the experimenter do."""

import random
import re
import signal
import subprocess
import sys
from dataclasses import dataclass, field
from html.parser import HTMLParser
from pathlib import Path
from time import sleep

import httpx

from steerlab.study.study import Study

TYPED = "34"  # a number, and a text
_LOOKS, _PAUSE_S = 100, 0.1

Attributes = list[tuple[str, str | None]]


class Console:
    """``steerlab console``, until it is killed or told to end.

    Attributes:
        address: of its pages.
        link: signs the experimenter in, once.
    """

    def __init__(
        self, folder: Path, device: str = "wheel", environment: dict[str, str] | None = None
    ) -> None:
        command = [sys.executable, "-m", "steerlab.app.cli", "console", str(folder), "--port", "0"]
        self._err = folder.parent / "console.err"
        with self._err.open("w") as err:
            self.process = subprocess.Popen(
                [*command, "--device", device],
                stdout=subprocess.PIPE,
                stderr=err,
                text=True,
                env=environment,
            )
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        found = re.search(r"((https?://\S+)/enter/\S+)", line)
        assert found, f"the console said {line!r} and {self._err.read_text()!r}"
        self.link, self.address = found[1], found[2]

    def kill(self) -> None:
        """SIGKILL."""
        self.process.kill()
        self._ended()

    def stop(self) -> list[str]:
        """Ctrl+C; what is wrong with how it ended, and with what it said all the time."""
        self.process.send_signal(signal.SIGINT)
        code, said = self._ended(), self._err.read_text(encoding="utf-8")
        return [f"the console ended with {code}: {said[-600:]}"] if code or said else []

    def _ended(self) -> int:
        code = self.process.wait(30)
        assert self.process.stdout is not None
        self.process.stdout.close()
        return code

    def __enter__(self) -> "Console":
        return self

    def __exit__(self, *error: object) -> None:
        if self.process.poll() is None:
            self.kill()


@dataclass
class Form:
    """A form of a page.

    Attributes:
        save: where single answers go; empty if nowhere.
        fields: what is filled in, hidden fields among it.
        choices: of each group of radio buttons or check boxes.
        texts: fields to type into.
        buttons: those that have a name.
    """

    action: str
    save: str
    fields: dict[str, str] = field(default_factory=dict)
    choices: dict[str, list[str]] = field(default_factory=dict)
    texts: list[str] = field(default_factory=list)
    buttons: list[tuple[str, str]] = field(default_factory=list)

    def fill(self, rng: random.Random) -> list[tuple[str, str]]:
        """Fill in what is empty; name and value of each, in the order of the page."""
        filled = {
            name: rng.choice(self.choices[name]) if name in self.choices else TYPED
            for name in (*self.choices, *self.texts)
            if name not in self.fields
        }
        self.fields |= filled
        return list(filled.items())


class _Reader(HTMLParser):
    """Reads the forms of a page; what is hidden until another answer is given is left out."""

    def __init__(self) -> None:
        super().__init__()
        self.forms: list[Form] = []
        self._skip = False

    def handle_starttag(self, tag: str, attrs: Attributes) -> None:
        known = {name: value or "" for name, value in attrs}
        if "data-item" in known:
            self._skip = "hidden" in known
        if tag == "form":
            self.forms.append(Form(known.get("action", ""), known.get("data-save", "")))
        elif self.forms and known.get("name") and not self._skip:
            self._input(self.forms[-1], tag, known)

    def _input(self, form: Form, tag: str, known: dict[str, str]) -> None:
        name, value, kind = known["name"], known.get("value", ""), known.get("type", "text")
        if tag == "button":
            form.buttons.append((name, value))
        elif kind in ("radio", "checkbox"):
            form.choices.setdefault(name, []).append(value)
        else:
            form.texts += [name] if kind == "text" else []
        if (
            (tag == "input" and kind == "hidden")
            or "checked" in known
            or (kind == "text" and value)
        ):
            form.fields.setdefault(name, value)


def forms_of(page: str) -> list[Form]:
    """All forms of a page."""
    reader = _Reader()
    reader.feed(page)
    return reader.forms


class Tablet:
    """A participant's browser, which outlives consoles.

    Attributes:
        kept: the answers that were acknowledged: value by phase, part and item.
        sent: all that were sent.
        consented: whether the consent was acknowledged.
    """

    def __init__(self, token: str, rng: random.Random) -> None:
        self.kept: dict[tuple[str, int, str], str] = {}
        self.sent: set[tuple[tuple[str, int, str], str]] = set()
        self.consented = False
        self._home, self._rng = f"/p/{token}", rng

    def walk(self, address: str) -> None:
        """Do page after page, answer by answer, until one has nothing to do.

        Raises:
            httpx.TransportError: the console is gone.
        """
        headers = {"origin": address}
        with httpx.Client(
            base_url=address, headers=headers, timeout=60, follow_redirects=True
        ) as client:
            page = client.get(self._home)
            while forms := forms_of(page.text):
                page = self._do(client, forms[0])
                assert page.status_code == 200, page.text

    def _do(self, client: httpx.Client, form: Form) -> httpx.Response:
        for name, value in form.fill(self._rng):
            if form.save:
                self._answer(client, form, name.removeprefix("item."), value)
        page = client.post(form.action, data=form.fields | dict(form.buttons[:1]))
        self.consented |= form.action.endswith("/consent")
        return page

    def _answer(self, client: httpx.Client, form: Form, item: str, value: str) -> None:
        *_, phase, part, _ = form.save.split("/")
        place = phase, int(part), item
        self.sent.add((place, value))
        data = {"csrf": form.fields["csrf"], "item": item, "value": value}
        answer = client.post(form.save, data=data)
        assert answer.status_code == 204, answer.text
        self.kept[place] = value

    def wrong(self, study: Study, participant: str) -> list[str]:
        """How the record differs from what was acknowledged; what was under way may be there."""
        view = study.participant(participant)
        found: dict[tuple[str, int, str], str] = {}
        for phase, _ in view.phases:
            for part, key in enumerate(phase.questionnaires, 1):
                for item, value in study.answers(participant, phase.id, key).items():
                    found[phase.id, part, item] = str(value)
        wrong = [
            f"{participant}: {item} was acknowledged as {value!r}, {found.get(item)!r} is kept"
            for item, value in self.kept.items()
            if found.get(item) != value
        ]
        unsent = {*found.items()} - self.sent
        wrong += [f"{participant}: {one} is kept and was never sent" for one in unsent]
        if self.consented and view.next_phase is not None and view.next_phase.id == "consent":
            wrong.append(f"the consent of {participant} is lost")
        return wrong


class Desk:
    """The experimenter's browser, signed in."""

    def __init__(self, console: Console) -> None:
        self._client = httpx.Client(
            base_url=console.address,
            headers={"origin": console.address},
            timeout=60,
            follow_redirects=True,
        )
        self.home = self._client.get(console.link).url.path

    def page(self, path: str = "") -> str:
        """One of the experimenter's pages."""
        answer = self._client.get(self.home + path)
        assert answer.status_code == 200, answer.text
        return answer.text

    def enrol(self) -> str:
        """A training participant's pseudonym."""
        (form,) = (form for form in forms_of(self.page()) if form.action.endswith("/enrol"))
        answer = self._client.post(form.action, data=form.fields | {"role": "training"})
        return answer.url.path.rpartition("/")[2]

    def act(self, participant: str, act: str, **fields: str) -> str:
        """The page after a participant's form, such as ``start``, which may be there only soon."""
        for _ in range(_LOOKS):
            page = self.page(f"/participants/{participant}")
            for form in forms_of(page):
                if form.action.endswith(f"{participant}/{act}"):
                    answer = self._client.post(form.action, data=form.fields | fields)
                    assert answer.status_code == 200, answer.text
                    return answer.text
            sleep(_PAUSE_S)
        raise AssertionError(f"there is no form to {act}: {page}")

    def token(self, participant: str) -> str:
        """Of a fresh link."""
        found = re.search(r'value="[^"]*/p/([^"]+)"', self.act(participant, "link"))
        assert found
        return found[1]

    def close(self) -> None:
        """Close the browser."""
        self._client.close()
