"""``steerlab``: the command line, and the only place where everything is put together.

Each verb is a typed function; what a verb needs is imported inside it, so that ``--help``
answers at once.
"""

import logging
import os
import signal
import sys
from collections.abc import Callable

import tyro

from steerlab.teleop.verbs.analyze import analyze
from steerlab.teleop.verbs.console import console
from steerlab.teleop.verbs.live import correct, drive, replay, wheel
from steerlab.teleop.verbs.machine import calibration_set, doctor
from steerlab.teleop.verbs.power import power
from steerlab.teleop.verbs.science import demo, fit, simulate, synthetic
from steerlab.teleop.verbs.study import study
from steerlab.teleop.verbs.teach import teach

VERBS: dict[str, Callable[..., int]] = {
    "demo": demo,
    "doctor": doctor,
    "wheel": wheel,
    "drive": drive,
    "correct": correct,
    "replay": replay,
    "study": study,
    "console": console,
    "simulate": simulate,
    "fit": fit,
    "synthetic": synthetic,
    "teach": teach,
    "analyze": analyze,
    "power": power,
    "calibration-set": calibration_set,
}


def main(arguments: list[str] | None = None) -> int:
    """Run one verb: 0 all well, 1 it found something wrong, 2 it could not be done."""
    from steerlab.sim.errors import SteerlabError

    logging.basicConfig(format="steerlab: %(message)s", level=logging.WARNING)
    arguments = sys.argv[1:] if arguments is None else arguments
    try:
        return tyro.extras.subcommand_cli_from_dict(
            VERBS,
            prog="steerlab",
            description="A driving lab for studying how people teach robots.",
            args=arguments or ["--help"],
        )
    except SteerlabError as error:
        print(f"steerlab: {error}", file=sys.stderr)
        return 2
    except BrokenPipeError:  # whoever read what we print has seen enough, such as ``head``
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 128 + signal.SIGPIPE
    except OSError as error:
        where = f" {error.filename}" if error.filename else ""
        print(f"steerlab: {error.strerror or error}{where}; check the path.", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("steerlab: stopped.", file=sys.stderr)
        return 128 + signal.SIGINT


if __name__ == "__main__":
    sys.exit(main())
