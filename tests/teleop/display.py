"""An X server for tests, and programs that run before it as a person would use them."""

import json
import os
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).parent


class Display:
    """An X server of its own; ``server`` may be killed, as displays do vanish."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        reading, writing = os.pipe()
        self.server = subprocess.Popen(
            ["Xvfb", "-displayfd", str(writing), "-screen", "0", "1280x720x24", "-nolisten", "tcp"],
            pass_fds=[writing],
            stderr=subprocess.DEVNULL,
        )
        os.close(writing)
        with os.fdopen(reading) as told:
            self.environment = os.environ | {"DISPLAY": f":{told.readline().strip()}"}
        self.environment.pop("SDL_VIDEODRIVER", None)
        self.environment["SDL_AUDIODRIVER"] = "dummy"

    def run(self, program: str, plan: dict, *arguments: str) -> subprocess.Popen[str]:
        """Start ``virtual_person.py`` or ``virtual_driver.py`` with what it is to do."""
        who = [sys.executable, str(HERE / program), str(self.folder), json.dumps(plan)]
        return subprocess.Popen(
            [*who, "--", *arguments],
            env=self.environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def close(self) -> None:
        self.server.kill()
        self.server.wait()
