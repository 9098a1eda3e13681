"""Does a better label make a better driver? ``python -m benchmarks.teach --out DIR [--jobs N]``.

Noise 0.5, softened drivers, population seed 2; settings were chosen on seeds from 100. Each part is
a resumable ``steerlab teach`` in its own folder of DIR, so it can be stopped and given again.
``--part speed`` times one teacher alone; ``main`` is slalom with the wide population and the five
learners of the paper's comparison, 40 teachers x 3 learner seeds. The others are smaller: ``all``
every learner on slalom (what ``main`` has taught is not taught again) and on hard; ``human`` the
narrower population; ``easy`` the control; ``raw`` drivers as clumsy as correctors; ``families`` test
teachers of other kinds. ``--teachers`` and ``--learner-seeds`` set their sizes.
"""

import shutil
import sys
from argparse import ArgumentParser
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any

import numpy as np

from benchmarks.rows import Row, at_least, at_most, print_rows
from steerlab.analysis.teach_report import table_lines
from steerlab.app.teach import teach
from steerlab.app.teach_config import TeachConfig
from steerlab.learning.agents import LEARNERS, PolicyLearner
from steerlab.learning.policy import IMAGE_SHAPE, MOTION_SIZE, Observations
from steerlab.learning.policy_training import TrainingRows
from steerlab.sim.unusual_teachers import OUT_OF_FAMILY

PAPER = ("bc", "dagger", "mind-meld", "mind-meld-mean", "oracle")
OTHER_MAPPERS = ("mapped:sim_pretrained", "mapped:person_ridge")
EVERYONE = (*(name for name in LEARNERS if ":" not in name), *OTHER_MAPPERS)
MAIN = TeachConfig(learners=PAPER, teachers=40, learner_seeds=3, seed=2)
SMALLER = replace(MAIN, teachers=20, learner_seeds=1)
TIMED = replace(
    MAIN, learners=("bc", "dagger", "mind-meld", "oracle"), teachers=1, learner_seeds=1, seed=100
)
PARTS = ("speed", "main", "human", "all", "easy", "raw", "families")


def run(
    parts: Sequence[str], out: Path, jobs: int, *, teachers: int | None, seeds: int | None
) -> list[Row]:
    """Rows for what has a limit; everything else is in the folders' summaries.

    Args:
        teachers: in place of each part's own number; likewise ``seeds``, of learners.
    """
    rows: list[Row] = []
    for part in parts:
        if part == "speed":
            rows += speed()
            continue
        for name, config in _configs(part):
            print(f"{name} ...", flush=True)
            if name == "all-slalom" and (out / "main").is_dir() and not (out / name).exists():
                shutil.copytree(out / "main", out / name)
            sized = replace(
                config,
                teachers=teachers or config.teachers,
                learner_seeds=seeds or config.learner_seeds,
            )
            summary = teach(
                sized, out / name, command=f"benchmarks.teach {name}", progress=_silent, jobs=jobs
            )
            print("\n".join(table_lines(summary)), flush=True)
            if name == "main" and summary["tests"]:
                rows += quality_rows(summary)
    return rows


def _configs(part: str) -> Iterator[tuple[str, TeachConfig]]:
    if part == "main":
        yield "main", MAIN
    elif part == "human":
        yield "human", replace(SMALLER, population="human")
    elif part == "all":
        for task in ("slalom", "hard"):
            yield f"all-{task}", replace(SMALLER, learners=EVERYONE, task=task)
    elif part == "easy":
        yield "easy", replace(SMALLER, task="easy")
    elif part == "raw":
        yield "raw", replace(SMALLER, driving="raw")
    else:
        for family in OUT_OF_FAMILY:
            yield f"family-{family}", replace(SMALLER, population="human", family=family)


def quality_rows(summary: dict[str, Any]) -> list[Row]:
    """The goals of the comparison."""
    found = summary["conditions"]
    mind_meld, dagger, mean = (found[name] for name in ("mind-meld", "dagger", "mind-meld-mean"))
    p_holm = next(
        test["p_holm"]
        for test in summary["tests"]
        if (test["a"], test["b"], test["metric"]) == ("mind-meld", "dagger", "success")
    )
    return [
        at_least("oracle: success", found["oracle"]["success"], 0.9),
        at_least("MIND MELD: success", mind_meld["success"], 0.8),
        at_least("success over DAgger", mind_meld["success"] - dagger["success"], 0.25),
        at_most("p (Holm) of that", p_holm, 0.01),
        at_most(
            "final distance, share of DAgger's",
            mind_meld["final_distance_m"] / dagger["final_distance_m"],
            0.5,
        ),
        at_least("success over mean embedding", mind_meld["success"] - mean["success"], 0.2),
        at_least(
            "label error removed on own drives",
            1.0 - mind_meld["label_mae"] / dagger["label_mae"],
            0.5,
        ),
    ]


def speed() -> list[Row]:
    """A teacher's comparison with evaluation, the mapper fitted before, on two processes."""
    with TemporaryDirectory() as folder:
        out = Path(folder) / "out"
        teach(replace(TIMED, rounds=1), out, command="", progress=_silent)
        model = out / "models" / "mind_meld.safetensors"
        started = perf_counter()
        teach(TIMED, Path(folder) / "timed", command="", progress=_silent, mapper=model, jobs=2)
        taught_s = perf_counter() - started
    return [
        at_most("a teacher x 4 learners x 12 rounds", taught_s, 60.0, "s"),
        at_most("training between two rounds", _training_s(), 3.0, "s"),
    ]


def _training_s() -> float:
    """After the last round, of 13 drives that took all their time."""
    rng = np.random.default_rng(0)
    rows = MAIN.make_task().decisions
    drives = [
        TrainingRows(
            Observations(
                rng.integers(0, 256, (rows, *IMAGE_SHAPE), dtype=np.uint8),
                rng.normal(size=(rows, MOTION_SIZE)).astype(np.float32),
            ),
            rng.normal(size=rows),
            np.ones(rows),
        )
        for _ in range(MAIN.rounds + 1)
    ]
    learner = PolicyLearner(0)
    started = perf_counter()
    learner.train(drives)
    return perf_counter() - started


def _silent(what: str, share: float) -> None:
    pass


def main(arguments: Sequence[str]) -> int:
    """Run the parts asked for."""
    parser = ArgumentParser(prog="python -m benchmarks.teach")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--part", choices=PARTS, action="append")
    parser.add_argument("--teachers", type=int)
    parser.add_argument("--learner-seeds", type=int)
    given = parser.parse_args(arguments)
    parts = given.part or PARTS
    return print_rows(
        run(parts, given.out, given.jobs, teachers=given.teachers, seeds=given.learner_seeds)
    )


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
