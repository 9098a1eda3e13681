"""A reader returns a value or raises ``SteerlabError``, whatever became of its file."""

import logging
import random
import traceback
from pathlib import Path

import pytest

from steerlab.sim.errors import SteerlabError
from tests.faults.readers import READERS, Reader, copied

CASES = 60  # of each reader here, times its share; `make soak` runs a million
MOST = 400


@pytest.fixture(scope="module", params=READERS, ids=lambda reader: reader.name)
def made(request, tmp_path_factory) -> tuple[Reader, Path]:
    reader = request.param
    return reader, reader.write(tmp_path_factory.mktemp(reader.name.replace(", ", "-")))


def test_what_the_writer_writes_is_read(made, tmp_path):
    reader, original = made
    assert reader.read(copied(original, tmp_path / "copy")) is not None


def test_a_damaged_file_is_refused_in_words_or_read(made, tmp_path, caplog):
    reader, original = made
    with caplog.at_level(logging.CRITICAL):
        leaks = fuzz(
            reader, original, tmp_path / "copy", range(min(MOST, int(CASES * reader.share)))
        )
    assert not leaks, "\n\n".join(leaks[:3])


def fuzz(reader: Reader, original: Path, room: Path, seeds: range) -> list[str]:
    """What was raised that is no ``SteerlabError``, or says nothing, once each kind."""
    leaks: dict[str, str] = {}
    for seed in seeds:
        path = copied(original, room)
        rng = random.Random(f"{reader.name}-{seed}")
        reader.damage(reader.damaged(path), rng)
        try:
            reader.read(path)
        except SteerlabError as error:
            if not str(error).strip() or len(str(error)) > 2000:
                leaks.setdefault("empty or endless", f"seed {seed}: {str(error)[:300]!r}")
        except Exception as error:
            frames = traceback.extract_tb(error.__traceback__)
            ours = [
                f"{f.filename.rsplit('/', 2)[-2:]}:{f.lineno}"
                for f in frames
                if "site-packages" not in f.filename
            ]
            key = f"{type(error).__name__} at {ours[-1]}"
            leaks.setdefault(
                key, f"{reader.name}, seed {seed}: {key}: {str(error)[:200]} via {ours[-4:]}"
            )
    return list(leaks.values())
