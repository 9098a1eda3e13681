"""Waiting for a person: a page until a key is pressed, or the countdown until the wheel is centred."""

from collections.abc import Callable
from dataclasses import replace

from steerlab.sim.language import said
from steerlab.teleop.devices.contract import Button, Device, DeviceSample
from steerlab.teleop.pacing import NS_PER_S
from steerlab.teleop.pages import CENTRED, ROLLOUT, countdown_page
from steerlab.teleop.screen.contract import Act, Page, Screen
from steerlab.teleop.watch import PersonWatch

PAGE_S = 1.0 / 30.0


class PagePrompt:
    """Shows pages on ``screen`` and listens to the keyboard and to ``device``.

    Args:
        poll: empties the event queue.
        now_ns, sleep_s: time itself; tests pass their own.
    """

    def __init__(
        self,
        screen: Screen,
        device: Device,
        poll: Callable[[], None],
        watch: PersonWatch,
        *,
        now_ns: Callable[[], int],
        sleep_s: Callable[[float], None],
    ) -> None:
        self._screen = screen
        self._device = device
        self._poll = poll
        self._watch = watch
        self._now_ns = now_ns
        self._sleep_s = sleep_s

    def countdown(self, number: int, count: int, seconds: float, *, what: str = ROLLOUT) -> bool:
        """3-2-1, running only while the wheel is centred and the window in focus; False to stop."""
        self._screen.acts()  # what was pressed before does not count
        period_ns = round(seconds * NS_PER_S)
        since_ns = self._now_ns()
        while True:
            self._poll()
            if Act.STOP in self._screen.acts():
                return False
            sample = self._device.read()
            focused = self._screen.focused
            centred = sample.ok and sample.wheel is not None and abs(sample.wheel) <= CENTRED
            now_ns = self._now_ns()
            if not (centred and focused):
                since_ns = now_ns
            left_ns = since_ns + period_ns - now_ns
            if left_ns <= 0:
                return True
            page = countdown_page(
                number,
                count,
                sample,
                left_s=left_ns / NS_PER_S,
                centred=centred,
                focused=focused,
                device=self._device.info.name,
                what=what,
            )
            self._screen.show_page(page)
            self._sleep_s(PAGE_S)

    def ask(self, page: Callable[[], Page], wanted: set[Act]) -> Act:
        """Show a page until one of ``wanted`` is pressed, on the keyboard or on the wheel."""
        self._watch.begin(self._device.read())
        while True:
            self._poll()
            for act in self._watch.acts(self._device.read()):
                if act in wanted:
                    return act
            self._screen.show_page(with_buttons(page(), self._device.info.buttons))
            self._sleep_s(PAGE_S)

    def until(
        self, page: Callable[[DeviceSample], Page], known: Callable[[DeviceSample], bool]
    ) -> bool:
        """Show a page until the device says what is wanted of it; False to stop."""
        while True:
            self._poll()
            sample = self._device.read()
            if known(sample):
                return True
            if Act.STOP in self._screen.acts():
                return False
            self._screen.show_page(page(sample))
            self._sleep_s(PAGE_S)

    def ready(self, page: Callable[[], Page]) -> bool:
        """Show a page until the person goes on with window and device ready; False to stop."""
        while True:
            if self.ask(page, {Act.CONFIRM, Act.STOP}) is Act.STOP:
                return False
            if self._screen.focused and self._device.read().ok:
                return True


_OR_BUTTON = {
    Button.PAUSE: "{does} (or the pause button)",
    Button.REDO: "{does} (or the redo button)",
}


def with_buttons(page: Page, buttons: frozenset[Button]) -> Page:
    """``page`` with what the wheel's buttons do on it, where the wheel has them."""
    named = {"Space": Button.PAUSE, "R": Button.REDO}
    keys = [
        (key, said(_OR_BUTTON[named[key]]).format(does=does) if named.get(key) in buttons else does)
        for key, does in page.keys
    ]
    return replace(page, keys=keys)
