import errno
from pathlib import Path

import pytest

from steerlab.sim.files.writing import why_not_written, writing


def test_the_systems_reason_is_found_by_writing_on(tmp_path: Path):
    assert why_not_written(tmp_path / "none" / "file", "no reason").errno == errno.ENOENT
    assert str(why_not_written(tmp_path / "file", "no reason")) == "no reason"


def test_a_librarys_error_is_one_of_the_system_and_others_pass(tmp_path: Path):
    with (
        pytest.raises(OSError, match=r"^Unable to write data$"),
        writing(tmp_path / "x", LookupError),
    ):
        raise LookupError("Unable to write data.")
    with pytest.raises(ZeroDivisionError), writing(tmp_path / "x", LookupError):
        _ = 1 / 0
