from dataclasses import replace

import numpy as np
import pytest

from steerlab.sim.errors import InvalidConfig
from steerlab.sim.vehicle import WHEEL_LIMIT
from steerlab.teleop.devices.calibration import STAGES, WheelCalibration, WizardStage
from steerlab.teleop.devices.contract import Button
from steerlab.teleop.devices.joystick import JoystickInfo, RawSample
from steerlab.teleop.devices.measuring import Motion, WizardConfig
from steerlab.teleop.devices.wizard import wizard_page

INFO = JoystickInfo(name="Odd wheel", guid="a" * 32, vendor=1, product=2, axes=4, buttons=8)


class Hands:
    """Does to a wheel what the wizard asks for; time passes only here."""

    def __init__(self, *, known=True, **config):
        self.wizard = WheelCalibration(INFO, system="linux", config=WizardConfig(**config))
        self.axes = [0.0, 0.0, 1.0, 1.0] if known else [None] * 4
        self.buttons = set()
        self.now_ns = 1_000_000_000
        self.motions = 0
        self.event_ns = None
        self.rng = np.random.default_rng(0)
        self.noise = 0.0
        self.look()

    def look(self, lost=False):
        self.now_ns += 2_000_000
        axes = list(self.axes)
        if self.noise and axes[0] is not None:
            axes[0] += float(self.rng.uniform(-self.noise, self.noise))
        self.wizard.advance(
            RawSample(
                axes=tuple(axes),
                buttons=frozenset(self.buttons),
                t_event_ns=self.event_ns,
                motions=self.motions,
                lost=lost,
            ),
            self.now_ns,
        )
        wizard_page(self.wizard)  # it must be possible to show it at any moment

    def move(self, axis, value):
        start = self.axes[axis] if self.axes[axis] is not None else 0.0
        for position in np.linspace(start, value, 40):
            self.axes[axis] = float(position)
            self.motions += 1
            self.event_ns = self.now_ns + 2_000_000
            self.look()

    def confirm(self):
        self.look()
        self.wizard.confirm()
        while self.wizard.measuring:
            self.look()

    def sweep(self, left=-0.9, right=0.95, axis=0, centre=0.0):
        self.move(axis, left)
        self.confirm()
        self.move(axis, right)
        self.confirm()
        self.move(axis, centre)
        self.confirm()

    def pedal(self, axis, pressed, rest, times=2):
        for _ in range(times):
            self.move(axis, pressed)
            self.confirm()
            self.move(axis, rest)
            self.confirm()

    def press(self, button):
        self.buttons.add(button)
        self.look()
        self.buttons.discard(button)
        self.look()

    def check(self, ends=(-1.0, 1.0), centre=0.0):
        for value in (*ends, centre):
            self.move(0, value)
        self.confirm()

    def all_of_it(self):
        self.confirm()
        self.sweep()
        self.pedal(2, -1.0, 1.0)
        self.pedal(3, -1.0, 1.0)
        for button in (5, 6, 7):
            self.press(button)
        self.check()
        return self.wizard.profile


def test_an_ordinary_wheel():
    hands = Hands()
    hands.confirm()
    assert hands.wizard.stage is WizardStage.LEFT
    hands.sweep()
    assert hands.wizard.stage is WizardStage.THROTTLE
    hands.pedal(2, -1.0, 1.0)
    assert hands.wizard.stage is WizardStage.BRAKE
    hands.pedal(3, -1.0, 1.0)
    assert hands.wizard.stage is WizardStage.PAUSE
    for button in (5, 6, 7):
        hands.press(button)
    assert hands.wizard.stage is WizardStage.CHECK
    hands.check()
    assert hands.wizard.finished
    profile = hands.wizard.profile
    assert profile.calibrated
    assert (profile.steering.axis, profile.steering.sign) == (0, -1)
    assert (profile.steering.minimum, profile.steering.maximum) == (-0.9, 0.95)
    assert (profile.throttle.axis, profile.throttle.rest, profile.throttle.pressed) == (2, 1.0, -1)
    assert (profile.brake.axis, profile.combined_pedals) == (3, False)
    assert profile.buttons == {Button.PAUSE: 5, Button.REDO: 6, Button.TAKE_OVER: 7}
    assert profile.match.guid == INFO.guid
    assert profile.measured.rate_hz == pytest.approx(500.0, rel=0.05)
    assert profile.measured.resolution > 0.0
    assert (profile.measured.noise, profile.measured.return_error) == (0.0, 0.0)


def test_a_wheel_that_grows_to_the_left():
    hands = Hands()
    hands.confirm()
    hands.sweep(left=1.0, right=-1.0)
    assert hands.wizard.ends.left == 1.0
    for _ in range(5):
        hands.wizard.skip()
    assert hands.wizard.profile.steering.sign == 1


def test_axes_of_which_nothing_is_heard_before_they_move():
    """Then the rest before the sweep is unknown too, and the wheel is let go twice."""
    hands = Hands(known=False)
    hands.confirm()
    hands.sweep()
    assert hands.wizard.stage is WizardStage.LET_GO
    assert "once more" in hands.wizard.problem
    hands.move(0, 0.3)
    hands.move(0, 0.02)
    hands.confirm()
    assert hands.wizard.stage is WizardStage.THROTTLE
    hands.pedal(2, -1.0, 1.0)
    hands.pedal(3, -1.0, 1.0)
    for button in (5, 6, 7):
        hands.press(button)
    hands.check()
    profile = hands.wizard.profile
    assert hands.wizard.finished
    assert profile.steering.centre == pytest.approx(0.01)
    assert profile.measured.return_error == pytest.approx(0.02 * WHEEL_LIMIT / 0.925)


def test_wherever_the_released_wheel_came_to_rest_it_reads_zero():
    hands = Hands()
    hands.axes[0] = -0.03
    hands.noise = 0.004
    hands.confirm()
    hands.sweep(centre=0.03)
    for _ in range(5):
        hands.wizard.skip()
    profile = hands.wizard.profile
    measured = profile.measured
    assert [profile.steering.wheel(raw) for raw in (-0.03, 0.0, 0.03)] == [0.0, 0.0, 0.0]
    assert profile.steering.wheel(0.1) != 0.0
    to_wheel = WHEEL_LIMIT / 0.925
    assert measured.noise == pytest.approx(0.004 / np.sqrt(3.0) * to_wheel, rel=0.1)
    assert measured.return_error == pytest.approx(0.06 * to_wheel, rel=0.05)


def test_combined_pedals():
    hands = Hands()
    hands.axes[1] = 0.0
    hands.confirm()
    hands.sweep()
    hands.pedal(1, -1.0, 0.0)
    hands.pedal(1, 1.0, 0.0)
    for _ in range(3):
        hands.wizard.skip()
    profile = hands.wizard.profile
    assert profile.combined_pedals
    assert (profile.throttle.axis, profile.brake.axis) == (1, 1)
    assert (profile.throttle.amount(-1.0), profile.brake.amount(-1.0)) == (1.0, 0.0)
    assert (profile.throttle.amount(1.0), profile.brake.amount(1.0)) == (0.0, 1.0)


def test_no_pedals_and_no_buttons():
    hands = Hands()
    hands.confirm()
    hands.sweep()
    for _ in range(5):
        hands.wizard.skip()
    hands.check()
    profile = hands.wizard.profile
    assert hands.wizard.finished
    assert (profile.throttle, profile.brake, profile.buttons) == (None, None, {})


def test_the_wheel_itself_cannot_be_skipped():
    hands = Hands()
    hands.wizard.skip()
    assert hands.wizard.stage is WizardStage.HANDS_OFF
    hands.confirm()
    hands.wizard.skip()
    assert hands.wizard.stage is WizardStage.LEFT


@pytest.mark.parametrize("known", [True, False])
def test_a_steering_axis_that_never_moves_is_said_and_can_be_tried_again(known):
    hands = Hands(known=known)
    hands.confirm()
    hands.confirm()
    hands.confirm()
    assert hands.wizard.stage is WizardStage.LEFT
    assert "No axis moved" in hands.wizard.problem
    assert wizard_page(hands.wizard).tone == "warning"
    hands.sweep()
    assert hands.wizard.ends.axis == 0


def test_the_largest_span_between_the_ends_is_the_steering():
    """A pedal pressed on the way is let go at both ends."""
    hands = Hands()
    hands.confirm()
    hands.move(3, -1.0)
    hands.move(3, 1.0)
    hands.sweep(axis=1, left=-0.5, right=0.5)
    assert hands.wizard.ends.axis == 1


def test_moving_during_hands_off_is_said():
    hands = Hands()
    hands.wizard.confirm()
    hands.move(0, 0.5)
    while hands.wizard.measuring:
        hands.look()
    assert hands.wizard.stage is WizardStage.HANDS_OFF
    assert "Something moved" in hands.wizard.problem
    hands.confirm()
    assert hands.wizard.stage is WizardStage.LEFT
    assert hands.wizard.problem == ""


@pytest.mark.parametrize(
    ("centre", "words"), [(0.8, "not near the middle"), (0.3, "elsewhere than before")]
)
def test_a_wheel_that_does_not_come_back_is_let_go_again(centre, words):
    hands = Hands()
    hands.confirm()
    hands.sweep(centre=centre)
    assert hands.wizard.stage is WizardStage.LET_GO
    assert words in hands.wizard.problem
    hands.move(0, 0.31 if centre == 0.3 else 0.0)
    hands.confirm()
    assert hands.wizard.stage is WizardStage.THROTTLE


def test_a_wheel_that_still_swings_is_let_go_again():
    hands = Hands()
    hands.confirm()
    hands.move(0, -0.9)
    hands.confirm()
    hands.move(0, 0.9)
    hands.confirm()
    hands.look()
    hands.wizard.confirm()
    hands.move(0, 0.0)
    while hands.wizard.measuring:
        hands.look()
    assert "still moved" in hands.wizard.problem


def at_throttle():
    hands = Hands()
    hands.confirm()
    hands.sweep()
    return hands


def test_a_pedal_that_does_not_move_is_asked_for_again():
    hands = at_throttle()
    hands.confirm()
    hands.confirm()
    assert "No pedal moved" in hands.wizard.problem
    assert hands.wizard.pedal_moments == []
    hands.pedal(2, -1.0, 1.0)
    assert hands.wizard.stage is WizardStage.BRAKE


def test_turning_the_wheel_is_no_pedal():
    hands = at_throttle()
    hands.pedal(0, -0.9, 0.0, times=1)
    assert "No pedal moved" in hands.wizard.problem


def test_another_pedal_the_second_time():
    hands = at_throttle()
    hands.pedal(2, -1.0, 1.0, times=1)
    hands.pedal(3, -1.0, 1.0, times=1)
    assert "Another pedal" in hands.wizard.problem


def test_a_half_pressed_pedal_the_second_time():
    hands = at_throttle()
    hands.pedal(2, -1.0, 1.0, times=1)
    hands.pedal(2, 0.0, 1.0, times=1)
    assert "differ" in hands.wizard.problem
    assert hands.wizard.stage is WizardStage.THROTTLE


def test_the_throttle_again_instead_of_the_brake():
    hands = at_throttle()
    hands.pedal(2, -1.0, 1.0)
    hands.pedal(2, -1.0, 1.0, times=1)
    assert hands.wizard.stage is WizardStage.BRAKE
    assert "throttle again" in hands.wizard.problem


def test_a_button_counts_once_and_when_it_goes_down():
    hands = at_throttle()
    hands.wizard.skip()
    hands.buttons.add(5)
    hands.look()
    hands.wizard.skip()
    assert hands.wizard.stage is WizardStage.PAUSE
    hands.look()  # button 5 is still held from before
    assert hands.wizard.stage is WizardStage.PAUSE
    hands.buttons.clear()
    hands.look()
    hands.press(5)
    assert hands.wizard.stage is WizardStage.REDO
    hands.press(5)
    assert hands.wizard.stage is WizardStage.REDO
    assert "taken already" in hands.wizard.problem
    hands.press(6)
    assert hands.wizard.stage is WizardStage.TAKE_OVER


def at_check():
    hands = at_throttle()
    for _ in range(5):
        hands.wizard.skip()
    return hands


def test_the_check_needs_both_ends_and_the_centre():
    hands = at_check()
    hands.check(ends=(-1.0, 0.3))
    assert "both ends" in hands.wizard.problem
    hands.check(centre=0.4)
    assert "return to the centre" in hands.wizard.problem
    assert not hands.wizard.finished
    hands.check()
    assert hands.wizard.finished


def test_the_check_page_shows_what_the_profile_makes_of_the_wheel():
    hands = at_check()
    hands.move(0, -0.9)
    page = wizard_page(hands.wizard)
    assert page.needle == WHEEL_LIMIT
    assert page.centre_band is not None
    assert any("+2.50 left" in line for line in page.lines)


def test_unplugging_starts_over():
    hands = at_throttle()
    hands.look(lost=True)
    assert hands.wizard.stage is WizardStage.HANDS_OFF
    assert "unplugged" in hands.wizard.problem
    assert hands.all_of_it() is not None
    assert hands.wizard.finished
    kept = hands.wizard.profile
    hands.look(lost=True)
    assert hands.wizard.profile is kept  # finished is finished


def test_starting_over_forgets_everything():
    hands = Hands()
    first = hands.all_of_it()
    again = Hands()
    again.confirm()
    again.sweep(left=0.5, right=-0.5, axis=1)
    again.pedal(3, 0.0, 1.0)
    again.wizard.again()
    again.axes = [0.0, 0.0, 1.0, 1.0]
    second = again.all_of_it()
    assert replace(second, measured=None, calibrated=False) == replace(
        first, measured=None, calibrated=False
    )


def test_pages_name_the_stage_and_count_up():
    hands = Hands(known=False)
    page = wizard_page(hands.wizard)
    assert (page.done, page.count) == (0, len(STAGES) - 1)
    assert page.needle is None
    assert page.bars == [(f"axis {number}", None) for number in range(4)]
    hands.confirm()
    hands.move(0, 0.5)
    page = wizard_page(hands.wizard)
    assert page.done == 1
    assert page.title.endswith("full left")
    assert page.bars[0] == ("axis 0", pytest.approx(0.75))


def test_motion_leaves_out_the_time_without_events():
    motion = Motion(1)
    t_ns = 0
    for burst in range(3):
        for k in range(11):
            t_ns += 4_000_000
            motion.add(
                RawSample(axes=(0.01 * k,), t_event_ns=t_ns, motions=burst * 11 + k, lost=False)
            )
        t_ns += 2_000_000_000
    assert motion.rate_hz == pytest.approx(250.0)
    assert motion.resolution(0) == pytest.approx(0.01)
    assert Motion(1).rate_hz == 0.0


def test_an_impossible_setting_is_refused():
    with pytest.raises(InvalidConfig, match="rest_s"):
        WizardConfig(rest_s=0.0)
