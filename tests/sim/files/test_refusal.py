import errno
import os

import pytest

from steerlab.sim.errors import SteerlabError
from steerlab.sim.files.machine import check_handles
from steerlab.sim.files.reading import reading
from steerlab.sim.files.refusal import ran_out, refusal
from steerlab.sim.files.whole_file import workspace


def test_what_ran_out_has_a_mend_of_its_own():
    full = OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    assert ran_out(full)
    assert refusal(full, "choose another path") == "No space left on device; make room on this disk"
    denied = OSError(errno.EACCES, os.strerror(errno.EACCES))
    assert not ran_out(denied)
    assert refusal(denied, "choose another path") == "Permission denied; choose another path"
    assert refusal(denied) == "Permission denied"


def test_a_librarys_own_words_around_the_systems_are_left_out():
    of_pyarrow = OSError(errno.ENOSPC, "Error writing bytes to file. Detail: [errno 28] No space")
    assert refusal(of_pyarrow) == "No space left on device; make room on this disk"


def test_a_file_that_cannot_be_opened_for_want_of_handles_is_not_called_damaged(tmp_path):
    with (
        pytest.raises(SteerlabError, match=r"cannot be read: Too many open files.*ulimit -n") as e,
        reading(tmp_path / "x", "a table", SteerlabError, "Is it damaged?"),
    ):
        raise OSError(errno.EMFILE, os.strerror(errno.EMFILE))
    assert "damaged" not in str(e.value)


def test_a_workspace_that_cannot_be_locked_for_want_of_handles_is_not_begun(tmp_path, monkeypatch):
    def none_left(self):
        raise OSError(errno.EMFILE, os.strerror(errno.EMFILE))

    monkeypatch.setattr("filelock.FileLock.acquire", none_left)
    with pytest.raises(OSError, match="Too many open files"), workspace(tmp_path / "out"):
        pytest.fail("it was begun")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(not os.path.isdir("/dev/fd"), reason="nothing says which handles are open")
def test_a_start_with_few_handles_says_how_many_there_are():
    check_handles()
    with pytest.raises(SteerlabError, match=r"needs 100000000: .*ulimit -n"):
        check_handles(100_000_000)
