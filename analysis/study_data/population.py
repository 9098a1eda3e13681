"""Reading a population run, the folder that ``steerlab simulate`` writes."""

from collections.abc import Sequence
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from steerlab.analysis.study_data.networks import embeddings_of, judge_both, network_for
from steerlab.analysis.study_data.records import Embeddings, HeldOut, NotAStudy, Person, StudyData
from steerlab.analysis.summary import Summary
from steerlab.learning.series import LabelSeries, series_from_table
from steerlab.learning.splits import split_rollouts, split_study
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.progress import Progress

LABELS, MODEL, SUMMARY = "labels", "models/mind_meld.safetensors", "summary.json"
_SPLITS = ("seen", "new")


def is_population_run(folder: Path) -> bool:
    """Whether ``folder`` is a population run: it has both label files."""
    return all((folder / LABELS / f"{name}.parquet").is_file() for name in _SPLITS)


def read_population(folder: Path, *, networks: int, progress: Progress) -> StudyData:
    """A run with its network, and ``networks`` - 1 more that are trained on other seeds; 0 for none.

    Raises:
        NotAStudy: a file is missing or damaged.
        SteerlabError: the labels or the model cannot be read.
    """
    from steerlab.learning.checkpoint import load_mapper

    if networks < 0:
        raise InvalidConfig(f"seeds is {networks}; give 0 or more.")
    try:
        summary = Summary.from_json((folder / SUMMARY).read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, InvalidConfig) as error:
        raise NotAStudy(f"{folder / SUMMARY} cannot be read: {error}") from error
    series = {name: _series(folder / LABELS / f"{name}.parquet") for name in _SPLITS}
    people = {name: list(dict.fromkeys(s.person for s in series[name])) for name in _SPLITS}
    everyone = (*series["seen"], *series["new"])
    rollouts = sorted({labels.rollout for labels in everyone})  # the calibration set's own order
    parts = split_rollouts(rollouts)
    split = split_study(everyone, parts, people["new"])
    first = load_mapper(folder / MODEL)
    embeddings: list[Embeddings] = []
    held_out: list[HeldOut] = []
    for number in range(networks):
        seed = first.seed + number
        mapper = (
            first
            if number == 0
            else network_for(
                split, first.config, seed=seed, cache=folder / "models", progress=progress
            )
        )
        source = "the run's network" if number == 0 else f"trained anew with seed {seed}"
        w = embeddings_of(mapper, people["seen"], seed=seed, source=source, held_out=parts.held_out)
        embeddings += [] if w is None else [w]
        held_out += judge_both(mapper, split, seed=seed)
    return StudyData(
        kind="population run",
        title=f"Simulated study, {summary.noise} noise, seed {summary.seed}",
        simulated=True,
        people=tuple(
            Person(id=person, role="training" if name == "seen" else "test")
            for name in _SPLITS
            for person in people[name]
        ),
        series=everyone,
        embeddings=tuple(embeddings),
        held_out=tuple(held_out),
        enrolled=len(people["seen"]) + len(people["new"]),
        notices=(
            "All participants are scripted teachers: the numbers say what the method does with "
            "teachers of known style, and nothing about people.",
        ),
    )


def _series(path: Path) -> Sequence[LabelSeries]:
    try:
        table = pq.read_table(path)
    except (OSError, pa.ArrowInvalid) as error:
        raise NotAStudy(f"{path} cannot be read: {error}") from error
    return series_from_table(table)
