"""The writer thread: the loop hands over what happened, and never waits for a disk."""

from collections.abc import Callable, Sequence
from concurrent.futures import Future
from queue import Empty, SimpleQueue
from threading import Thread
from time import perf_counter_ns, sleep
from typing import Any, TypeVar

from steerlab.sim.errors import SteerlabError
from steerlab.sim.records import LabelledStep
from steerlab.study.recording.live_rerun import LiveRerun
from steerlab.study.store.records import Attempt, AttemptData, Event, Flag
from steerlab.study.store.store import StudyStore
from steerlab.teleop.timing import StepTiming
from steerlab.teleop.timing_limits import TimingViolation

Result = TypeVar("Result")

# The thread polls for orders this often. If it waited on the queue instead, the loop would pay for
# waking it, and for the interpreter's lock that it then wants: 50 µs instead of 5 in 1 % of the steps.
_LOOK_S = 0.004


class RecordingError(SteerlabError):
    """Steps can no longer be kept; what was kept before is safe."""


class WriterThread:
    """Runs calls one after another in another thread; calls given to ``tell`` must not raise."""

    def __init__(self) -> None:
        self._orders: SimpleQueue[tuple[Callable[..., Any], Any, Any] | None] = SimpleQueue()
        self.tell = self._orders.put  # (function, argument, argument); bound once, for speed
        self._thread = Thread(target=self._work, name="steerlab-writer", daemon=True)
        self._thread.start()

    def ask(self, act: Callable[[], Result]) -> Result:
        """Have ``act`` done after all before it; returns or raises what it does.

        Raises:
            RecordingError: the thread was stopped.
        """
        if not self._thread.is_alive():
            raise RecordingError("This recorder is closed; make a new one.")
        answer: Future[Result] = Future()
        self._orders.put((_answer, act, answer))
        return answer.result()

    def stop(self) -> None:
        """Return when everything has been done; calling it again does nothing."""
        self._orders.put(None)
        self._thread.join()

    def _work(self) -> None:
        while True:
            try:
                order = self._orders.get_nowait()
            except Empty:
                sleep(_LOOK_S)
                continue
            if order is None:
                return
            act, first, second = order
            act(first, second)


def _answer(act: Callable[[], Result], answer: "Future[Result]") -> None:
    try:
        answer.set_result(act())
    except BaseException as error:  # of any kind: ``ask`` raises it
        answer.set_exception(error)


class AttemptWriter:
    """Keeps one attempt; ``SessionRecorder.begin`` makes it.

    Attributes:
        attempt: 0 for the participant's first try at this drive, then 1, and so on.
        order: counts the participant's tries at any drive.
    """

    def __init__(
        self, thread: WriterThread, store: StudyStore, live: LiveRerun | None, stored: Attempt
    ) -> None:
        self.attempt, self.order = stored.attempt, stored.order_index
        self.stored = stored
        self.open = True
        self._thread = thread
        self._store = store
        self._live = live
        self._failure: Exception | None = None

    def step(self, step: LabelledStep, timing: StepTiming | None) -> None:
        """Hand over one step; returns at once.

        Raises:
            RecordingError: an earlier step could not be kept; the drive must stop.
        """
        if self._failure is not None:
            self.check()
        self._thread.tell((self._keep_step, step, timing))

    def event(self, step: int, what: str) -> None:
        """Hand over something that happened at this step; returns at once.

        Raises:
            RecordingError: as for ``step``.
        """
        self.check()
        self._thread.tell(
            (self._keep_event, Event(step=step, at_ns=perf_counter_ns(), what=what), None)
        )

    def check(self) -> None:
        """Ask whether everything could be kept so far; returns at once.

        Raises:
            RecordingError: something could not.
        """
        if self._failure is not None:
            raise RecordingError(
                f"The drive cannot be recorded any further and does not count. {self._failure} "
                f"What was recorded before is safe."
            ) from self._failure

    def finish(self, failed: Sequence[TimingViolation] = ()) -> None:
        """Wait until everything is on the disk, and mark the attempt as finished.

        Args:
            failed: the limits of timing that it broke; kept with it.

        Raises:
            RecordingError: something could not be kept; the attempt is then not finished.
        """
        flags = [Flag(name=gate.name, value=gate.value, bound=gate.limit) for gate in failed]
        self._end(lambda: self._store.finish_attempt(self.stored, flags))
        self.check()

    def abandon(self, reason: str) -> None:
        """Wait until everything is on the disk, and mark the attempt as given up.

        Raises:
            RecordingError: that could not be kept; the attempt is abandoned at the next start.
        """

        def mark() -> None:
            why = reason
            if self._failure is not None:
                why = " ".join(f"{reason}; steps are missing: {self._failure}".split())
            self._store.abandon_attempt(self.stored, why)
            self._failure = None

        self._end(mark, despite_failure=True)
        self.check()

    def _end(self, mark: Callable[[], None], *, despite_failure: bool = False) -> None:
        def end() -> None:
            if self._failure is not None and not despite_failure:
                return
            try:
                mark()
                self.open = False
            except SteerlabError as error:
                self._failure = error

        self._thread.ask(end)
        if self._live is not None and not self.open:
            self._thread.tell((self._show_end, self._live, None))

    # In the writer thread. After a failure nothing more is kept: an attempt has no holes.

    def _keep_step(self, step: LabelledStep, timing: StepTiming | None) -> None:
        if self._failure is not None:
            return
        try:
            self._store.append(step, timing)
        except Exception as error:  # the loop thread raises it
            self._failure = error
            return
        if self._live is not None:
            self._live.step(step, timing)

    def _keep_event(self, event: Event, _: None) -> None:
        if self._failure is not None:
            return
        try:
            self._store.add_event(self.stored, event)
        except Exception as error:  # the loop thread raises it
            self._failure = error
            return
        if self._live is not None:
            self._live.event(event)

    def _show_end(self, live: LiveRerun, _: None) -> None:
        live.end(self._read)

    def _read(self) -> AttemptData:
        now = next(a for a in self._store.attempts() if a.key == self.stored.key)
        return self._store.attempt_data(now)
