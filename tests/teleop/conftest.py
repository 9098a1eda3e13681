"""An X server of a test's own, for windows that a person sits before."""

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.teleop.display import Display


@pytest.fixture
def x_display(tmp_path: Path) -> Iterator[str]:
    """What ``DISPLAY`` is to be."""
    if shutil.which("Xvfb") is None:
        pytest.skip("not installed: Xvfb")
    display = Display(tmp_path)
    yield display.environment["DISPLAY"]
    display.close()
