"""The calibration wizard: from what a person does with an unknown wheel to its profile.

A pure state machine: it is fed with samples and key presses and never reads a clock or a device.
"""

from enum import StrEnum

from steerlab.teleop.devices.contract import Button, DeviceSample
from steerlab.teleop.devices.joystick import JoystickInfo, RawSample
from steerlab.teleop.devices.measuring import (
    AxisRest,
    Motion,
    SteeringEnds,
    Unclear,
    WizardConfig,
    measured_profile,
    pedal_axis,
    released_wheel,
    steering_ends,
    untouched,
)
from steerlab.teleop.devices.profile import PedalAxis, WheelProfile
from steerlab.teleop.devices.wheel import read_wheel


class WizardStage(StrEnum):
    """What the person is asked to do, in order."""

    HANDS_OFF = "hands off"
    LEFT = "full left"
    RIGHT = "full right"
    LET_GO = "let go"
    THROTTLE = "throttle"
    BRAKE = "brake"
    PAUSE = "pause button"
    REDO = "redo button"
    TAKE_OVER = "take-over button"
    CHECK = "check"
    FINISHED = "finished"


STAGES = tuple(WizardStage)
SWEEP = (WizardStage.LEFT, WizardStage.RIGHT, WizardStage.LET_GO)
RESTS = (WizardStage.HANDS_OFF, WizardStage.LET_GO)
PEDALS = (WizardStage.THROTTLE, WizardStage.BRAKE)
BUTTONS = {
    WizardStage.PAUSE: Button.PAUSE,
    WizardStage.REDO: Button.REDO,
    WizardStage.TAKE_OVER: Button.TAKE_OVER,
}


class WheelCalibration:
    """Calibrates one joystick.

    Args:
        joystick: the one that is calibrated.
        system: operating system the profile is for.
        name: what to call the wheel; the joystick's own name by default.

    Attributes:
        stage: the current one.
        problem: what went wrong last, in words for the person; empty if nothing did.
        measuring: a released wheel is being measured.
        pedal_moments: axes when the pedal was pressed, released, pressed, released.
        sample: the last one.
        ends: of the steering, once they are known.
        profile: once the check screen is reached; good only when ``finished``.
        reached: lowest and highest wheel position on the check screen.
    """

    def __init__(
        self,
        joystick: JoystickInfo,
        *,
        system: str,
        name: str = "",
        config: WizardConfig | None = None,
    ) -> None:
        self.joystick = joystick
        self.config = config or WizardConfig()
        self._system = system
        self._name = name or joystick.name
        self._now_ns = 0
        self.sample = RawSample(axes=(None,) * joystick.axes)
        self.again()

    def again(self) -> None:
        """Start over."""
        self.stage = WizardStage.HANDS_OFF
        self.problem = ""
        self.measuring = False
        self.pedal_moments: list[tuple[float | None, ...]] = []
        self.ends: SteeringEnds | None = None
        self.profile: WheelProfile | None = None
        self.reached = (0.0, 0.0)
        self._measured: list[RawSample] = []
        self._until_ns = 0
        self._first_rests: list[AxisRest | None] = []
        self._rests: list[AxisRest] = []
        self._motion = Motion(self.joystick.axes)
        self._left: tuple[float | None, ...] = ()
        self._pedals: dict[WizardStage, PedalAxis] = {}
        self._numbers: dict[Button, int] = {}

    @property
    def finished(self) -> bool:
        """The person has confirmed the check screen."""
        return self.stage is WizardStage.FINISHED

    @property
    def checked(self) -> DeviceSample | None:
        """The last sample, read with the new profile; None before there is one."""
        return None if self.profile is None else read_wheel(self.profile, self.sample)

    def advance(self, sample: RawSample, now_ns: int) -> None:
        """Take what the joystick says now; call it often, about every millisecond."""
        if self.finished:
            return
        before, self.sample, self._now_ns = self.sample, sample, now_ns
        if sample.lost:
            self.again()
            self.problem = "The wheel was unplugged. Plug it in; it starts over."
            return
        if self.stage in SWEEP:
            self._motion.add(sample)
        if self.measuring:
            self._measured.append(sample)
            if now_ns >= self._until_ns:
                self.measuring = False
                self._try()
        elif self.stage in BUTTONS:
            self._look_for_button(sample.buttons - before.buttons)
        elif self.stage is WizardStage.CHECK and self.checked is not None:
            wheel = self.checked.wheel
            if wheel is not None:
                self.reached = (min(self.reached[0], wheel), max(self.reached[1], wheel))

    def confirm(self) -> None:
        """The person says that the wheel, or the pedal, is where it was asked to be."""
        if self.measuring or self.finished or self.sample.lost or self.stage in BUTTONS:
            return
        self.problem = ""
        if self.stage in RESTS:
            self.measuring = True
            self._measured = [self.sample]
            self._until_ns = self._now_ns + round(self.config.rest_s * 1e9)
        else:
            self._try()

    def skip(self) -> None:
        """Skip a pedal or a button that the wheel does not have."""
        if self.stage in PEDALS or self.stage in BUTTONS:
            self._next()

    def _try(self) -> None:
        """Evaluate this stage and go on if it is done, else say what is wrong."""
        try:
            done = self._conclude()
        except Unclear as unclear:
            self.problem = str(unclear)
            self.pedal_moments = []
            if self.stage is WizardStage.RIGHT:
                self.stage = WizardStage.LEFT
        else:
            if done:
                self._next()

    def _conclude(self) -> bool:
        """Evaluate this stage; True if it is done.

        Raises:
            Unclear: it has to be done again.
        """
        if self.stage is WizardStage.HANDS_OFF:
            self._first_rests = untouched(self._measured, self.config)
        elif self.stage is WizardStage.LEFT:
            self._left = self.sample.axes
        elif self.stage is WizardStage.RIGHT:
            self.ends = steering_ends(self._left, self.sample.axes, self.config)
            first = self._first_rests[self.ends.axis]
            self._rests = [] if first is None else [first]
        elif self.stage is WizardStage.LET_GO:
            self._compare_rests(self._ends())
        elif self.stage in PEDALS:
            return self._pedal_moment()
        else:
            self._check()
        return True

    def _next(self) -> None:
        self.problem = ""
        self.pedal_moments = []
        self.stage = STAGES[STAGES.index(self.stage) + 1]
        if self.stage is WizardStage.CHECK:
            self.profile = measured_profile(
                self.joystick,
                system=self._system,
                name=self._name,
                ends=self._ends(),
                rests=(self._rests[-2], self._rests[-1]),
                motion=self._motion,
                throttle=self._pedals.get(WizardStage.THROTTLE),
                brake=self._pedals.get(WizardStage.BRAKE),
                buttons=self._numbers,
            )

    def _ends(self) -> SteeringEnds:
        assert self.ends is not None, "stages after RIGHT know the ends"
        return self.ends

    def _compare_rests(self, ends: SteeringEnds) -> None:
        """Two resting positions must agree; the one before the sweep is the first, if known."""
        self._rests.append(released_wheel(self._measured, ends, self.config))
        if len(self._rests) < 2:
            raise Unclear("Good. Now turn it a little and let it go once more.")
        if self._return_error() > self.config.max_return_error * ends.side:
            raise Unclear("It came to rest elsewhere than before. Turn it, and let it go again.")

    def _return_error(self) -> float:
        return abs(self._rests[-1].centre - self._rests[-2].centre)

    def _pedal_moment(self) -> bool:
        self.pedal_moments.append(self.sample.axes)
        if len(self.pedal_moments) % 2:
            return False
        throttle = self._pedals.get(WizardStage.THROTTLE)
        other = throttle if self.stage is WizardStage.BRAKE else None
        pedal = pedal_axis(self.pedal_moments, self._ends().axis, other, self.config)
        self._pedals[self.stage] = pedal
        return len(self.pedal_moments) == 4

    def _look_for_button(self, pressed: frozenset[int]) -> None:
        if not pressed:
            return
        number = min(pressed)
        if number in self._numbers.values():
            self.problem = f"Button {number} is taken already. Press another one."
            return
        self._numbers[BUTTONS[self.stage]] = number
        self._next()

    def _check(self) -> None:
        wheel = None if self.checked is None else self.checked.wheel
        low, high = self.reached
        if wheel is None or low > -self.config.reached or high < self.config.reached:
            raise Unclear("Turn all the way to both sides first, so that both ends are seen.")
        if abs(wheel) > self.config.centre_band:
            raise Unclear("Let the wheel return to the centre, then go on.")
