"""Whatever a library raises while it reads a file becomes one of our errors."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from steerlab.sim.errors import SteerlabError
from steerlab.sim.files.refusal import ran_out, refusal

_LONGEST = 160  # characters of a library's message


@contextmanager
def reading(path: Path, what: str, error: type[SteerlabError], remedy: str) -> Iterator[None]:
    """Read ``path`` in this block, with a library and with what takes its values apart.

    Libraries raise nearly anything on a damaged file (``RecursionError``, ``OverflowError``,
    ``SafetensorError``, each ``pa.ArrowException``, ...), so all of it is taken as damage: only
    what reads the file belongs here.

    Args:
        what: the file should be, such as ``a rollout file``.
        remedy: a sentence: what to do about a file that is damaged or of another kind.

    Raises:
        SteerlabError: ours pass as they are; a library's comes as ``error``.
    """
    try:
        yield
    except SteerlabError:
        raise
    except Exception as why:
        if isinstance(why, OSError) and ran_out(why):  # the file may be as it should be
            raise error(f"{path} cannot be read: {refusal(why, remedy)}.") from why
        reason = getattr(why, "strerror", None) or str(why) or type(why).__name__
        if isinstance(why, FileNotFoundError):
            reason = "there is no such file"
        elif isinstance(why, KeyError):
            reason = f"it lacks {why}"
        reason = " ".join(reason.split())
        short = reason if len(reason) <= _LONGEST else f"{reason[: _LONGEST - 3]}..."
        raise error(f"{path} cannot be read as {what}: {short.rstrip('.')}. {remedy}") from why
