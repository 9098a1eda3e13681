"""How far a label lags behind what the participant saw, as far as this program causes it."""

from steerlab.teleop.pacing import PacingConfig


def input_latency_ms(frame_ms: float, pacing: PacingConfig) -> float:
    """From a state of the car until a label could answer it, on average.

    A state is on the display when its frame has been drawn and shown, and an event waits half a
    poll until it is taken. The display's and the wheel's own delays are not in it: they need a
    camera to measure, and come on top.

    Args:
        frame_ms: median time to draw a frame and hand it to the window system.
    """
    return frame_ms + 1e3 * pacing.poll_s / 2.0
