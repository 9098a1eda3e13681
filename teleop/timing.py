"""When a control step really happened: data that is kept beside each label."""

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True, slots=True)
class StepTiming:
    """Monotonic times of one control step, all of ``perf_counter_ns``.

    Attributes:
        deadline_ns: when the step was due: the attempt's start plus a whole number of periods.
        actual_ns: when the loop woke for it.
        sample_ns: when the device was read, right after.
        event_age_ns: age of the device's last event then; None when it never had one.
        overrun: the step came so late that a whole display frame was lost.
        focus: the window had the keyboard's focus.
        device_ok: the device was connected and known.
    """

    deadline_ns: int
    actual_ns: int
    sample_ns: int
    event_age_ns: int | None
    overrun: bool
    focus: bool
    device_ok: bool

    @property
    def lateness_ns(self) -> int:
        """How late the loop woke; never negative, for it does not wake early."""
        return self.actual_ns - self.deadline_ns
