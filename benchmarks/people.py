"""What holds on people: ``python -m benchmarks.people --data DIR [--task preview] [--drop 1] ...``.

The data are not ours to ship: the repository EmDash00/CPHS2017 has no licence. Fetch a copy and give
its ``experiment/data`` as DIR. People held a first-order cursor (gain 1) on a reference for 45 s at
60 Hz, with a disturbance and no reference to follow (``rejection``), or with a reference that they saw
coming and no disturbance (``preview``). Counted are the people who have all ten trials of either kind:
five drives and their mirror images; trials whose names end otherwise (restarted, rejected) are not.

The input is the label, the truth what ``steerlab.learning.tracking`` says; both are scaled so that the
largest is 2.5. Each of the five drives is held out in turn, with its mirror images; people are dealt
over the same five folds, so in each fold a fifth of them is new and calibrated on the other drives. A
seed trains anew and deals one fold further on: with five, everyone was new on every drive. Printed is
the error removed in percent, seeds pooled, with a 95 % interval over people and drives, and seed by
seed. ``--drop 1`` leaves out whoever has the largest mean error; ``--mappers`` names what to fit,
for a quick look.
"""

import re
import sys
from argparse import ArgumentParser
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.rows import Row, at_least, print_rows
from steerlab.learning.baselines import BASELINES, fit_baselines, left_out
from steerlab.learning.batch_mapping import map_in_chunks
from steerlab.learning.errors import InvalidLabels
from steerlab.learning.label_quality import two_way_ci95
from steerlab.learning.mapper import LabelMapper, MindMeldMapper
from steerlab.learning.presets import LAB
from steerlab.learning.pretrained.mapper import SimPretrainedMapper
from steerlab.learning.series import LabelSeries, by_person
from steerlab.learning.splits import RolloutSplit, StudySplit, drive_names, split_study
from steerlab.learning.tracking import holding_input
from steerlab.learning.training_budget import fit_long_enough
from steerlab.sim.arrays import FloatArray
from steerlab.sim.errors import SteerlabError
from steerlab.sim.vehicle import WHEEL_LIMIT

TASKS = {"rejection": "r-zer_d-sos+A", "preview": "r-sos+A_d-zer"}
DRIVES = 5
IMAGES = ("+1", "-1")
RATE_HZ = 60.0
GAIN = 1.0
COLUMNS = ("time", "ref", "inp", "dis")
FROZEN = "sim_pretrained_frozen"
MAPPERS = (*BASELINES, FROZEN)
SPLITS = ("seen", "new")
DEALING_SEED = 0

_NETWORKS = (
    "mind_meld",
    "mean_embedding",
    "shuffled_embedding",
    "auto",
)  # they need MIND MELD fitted
_LEAST_OVER = {"rejection": 0.0, "preview": -0.01}  # of the frozen network, over eb_nonlinear
_LEAST_OF_AUTO = -0.01  # over the best baseline
_LEAST_PREVIEW = 0.25
_TRIAL = re.compile(r".+_fo_(?P<task>r-\S+?_d-\S+?)_s\d+_p(?P<drive>\d)a\d+_(?P<image>[+-]1)\.csv")


@dataclass(frozen=True, kw_only=True, slots=True)
class Pooled:
    """Summed errors of one mapper on one split, (people, drives), each cell the mean over seeds.

    Attributes:
        by_seed: improvement of each seed alone.
    """

    before: FloatArray
    after: FloatArray
    by_seed: tuple[float, ...]

    @property
    def improvement(self) -> float:
        """Share of the error that is removed."""
        return 1.0 - float(self.after.sum() / self.before.sum())


def find_trials(data: Path, task: str) -> dict[str, dict[tuple[int, str], Path]]:
    """By person, the trials of ``task`` by drive and mirror image; of repeated ones the last.

    Raises:
        InvalidLabels: DIR has fewer than two people with all trials of every task.
    """
    found: dict[str, dict[str, dict[tuple[int, str], Path]]] = {}
    for path in sorted(data.glob("*/*.csv")):
        if (name := _TRIAL.fullmatch(path.name)) and name["task"] in TASKS.values():
            of_task = found.setdefault(path.parent.name, {}).setdefault(name["task"], {})
            of_task[int(name["drive"]), name["image"]] = path
    wanted = {(drive, image) for drive in range(DRIVES) for image in IMAGES}
    complete = {
        person: tasks[TASKS[task]]
        for person, tasks in found.items()
        if all(set(tasks.get(code, ())) == wanted for code in TASKS.values())
    }
    if len(complete) < 2:
        raise InvalidLabels(
            f"{data} has {len(complete)} people with {len(wanted)} first-order trials of each kind; "
            f"give the experiment/data folder of a copy of EmDash00/CPHS2017."
        )
    return complete


def read_series(data: Path, task: str) -> list[LabelSeries]:
    """Everyone's trials, scaled so that the largest label or truth is ``WHEEL_LIMIT``.

    Raises:
        InvalidLabels: see ``find_trials``; or a file is no trial.
    """
    trials = [
        (person, f"p{drive}{image}", *_read_trial(path))
        for person, of_person in sorted(find_trials(data, task).items())
        for (drive, image), path in sorted(of_person.items())
    ]
    largest = max(float(np.nanmax(np.abs([label, truth]))) for _, _, label, truth in trials)
    return scaled(
        [
            LabelSeries(
                person=person,
                rollout=rollout,
                rate_hz=RATE_HZ,
                label=label / largest,
                truth=truth / largest,
                valid=np.isfinite(label) & np.isfinite(truth),
            )
            for person, rollout, label, truth in trials
        ]
    )


def scaled(series: Sequence[LabelSeries]) -> list[LabelSeries]:
    """The same, the largest label or truth being ``WHEEL_LIMIT``."""
    largest = max(float(np.nanmax(np.abs([one.label, one.truth]))) for one in series)
    factor = WHEEL_LIMIT / largest
    return [
        LabelSeries(
            person=one.person,
            rollout=one.rollout,
            rate_hz=one.rate_hz,
            label=np.clip(factor * one.label, -WHEEL_LIMIT, WHEEL_LIMIT),  # rounding
            truth=np.clip(factor * one.truth, -WHEEL_LIMIT, WHEEL_LIMIT),
            valid=one.valid,
        )
        for one in series
    ]


def without_wildest(
    series: Sequence[LabelSeries], count: int
) -> tuple[list[LabelSeries], list[str]]:
    """Without the ``count`` people of the largest mean error, scaled anew; and who they are."""
    error = {
        person: float(
            np.mean(np.concatenate([np.abs(one.label - one.truth)[one.valid] for one in drives]))
        )
        for person, drives in by_person(series).items()
    }
    ranked = sorted(error, key=lambda person: -error[person])
    if len(ranked) - count < 2:
        raise InvalidLabels(f"--drop {count} leaves {len(ranked) - count} people; it takes two.")
    dropped = ranked[:count]
    said = [f"{person} (mean error {error[person]:.2f})" for person in dropped]
    return scaled([one for one in series if one.person not in dropped]), said


def folds(series: Sequence[LabelSeries], seed: int) -> Iterator[StudySplit]:
    """Each drive held out once; the people dealt over the folds, ``seed`` folds further on."""
    names = sorted({one.rollout for one in series})
    people = list(by_person(series))
    shuffled = np.random.default_rng(DEALING_SEED).permutation(len(people))
    for fold in range(DRIVES):
        held_out = tuple(name for name in names if _drive(name) == fold)
        train = tuple(name for name in names if name not in held_out)
        new = [
            people[index] for rank, index in enumerate(shuffled) if (rank + seed) % DRIVES == fold
        ]
        yield split_study(series, RolloutSplit(train=train, held_out=held_out), new)


def fitted(split: StudySplit, names: Collection[str], seed: int) -> dict[str, LabelMapper]:
    """The mappers of ``names`` that can be judged, fitted on the seen people, new ones calibrated."""
    without = {*left_out([split], LAB, full=True), *(set(BASELINES) - set(names))}
    if set(_NETWORKS) & set(names):
        mind_meld = fit_long_enough(split.train_seen, LAB, seed, "", _silent)
        mind_meld.calibrate(split.calibrate_new)
    else:
        mind_meld = MindMeldMapper(LAB, seed=seed)
    mappers = fit_baselines(
        mind_meld, split, seed=seed, on_step=lambda share: None, without=without
    )
    if FROZEN in names:
        frozen = SimPretrainedMapper(fine_tuning=None)
        frozen.fit(split.train_seen)
        frozen.calibrate(split.calibrate_new)
        mappers[FROZEN] = frozen
    return {name: mapper for name, mapper in mappers.items() if name in names}


def measured(
    series: Sequence[LabelSeries], names: Collection[str], seeds: Sequence[int]
) -> dict[str, dict[str, Pooled]]:
    """Errors by mapper and split."""
    people = list(by_person(series))
    sums: dict[tuple[str, str], FloatArray] = {}  # (seeds, before | after, people, drives)
    scored = {split: np.zeros((len(seeds), len(people), DRIVES), dtype=bool) for split in SPLITS}
    for turn, seed in enumerate(seeds):
        for fold in folds(series, seed):
            mappers = fitted(fold, names, seed)
            for split in SPLITS:
                held_out: tuple[LabelSeries, ...] = getattr(fold, f"held_out_{split}")
                for chunk, by_mapper in map_in_chunks(mappers, held_out):
                    for place, one in enumerate(chunk):
                        cell = (people.index(one.person), _drive(one.rollout))
                        scored[split][turn, *cell] = True
                        for name, mapped in by_mapper.items():
                            empty = np.zeros((len(seeds), 2, len(people), DRIVES))
                            total = sums.setdefault((name, split), empty)
                            for which, guess in enumerate((one.label, mapped[place])):
                                error = np.abs(guess - one.truth)[one.valid].sum()
                                total[turn, which, *cell] += error
            print(".", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    pooled: dict[str, dict[str, Pooled]] = {}
    for (name, split), total in sums.items():
        before, after = total.sum(axis=0) / np.maximum(scored[split].sum(axis=0), 1)
        by_seed = 1.0 - total[:, 1].sum(axis=(1, 2)) / total[:, 0].sum(axis=(1, 2))
        pooled.setdefault(name, {})[split] = Pooled(
            before=before, after=after, by_seed=tuple(by_seed.tolist())
        )
    return pooled


def show(found: dict[str, dict[str, Pooled]]) -> None:
    """A line a mapper: percent removed, interval over people and drives, each seed's own."""
    print(f"  {'error removed, %':24}" + "".join(f"{split:>24}" for split in SPLITS) + "   seeds")
    for name, by_split in found.items():
        cells, seeds = "", ""
        for split in SPLITS:
            one = by_split[split]
            low, high = two_way_ci95(one.before, one.after, np.random.default_rng(0))
            interval = f"[{100 * low:.0f}, {100 * high:.0f}]"
            cells += f"{100 * one.improvement:12.1f} {interval:>11}"
            seeds += f"   {split} " + " ".join(f"{100 * value:.1f}" for value in one.by_seed)
        print(f"  {name:24}{cells}{seeds}", flush=True)


def limits(found: dict[str, dict[str, Pooled]], task: str) -> list[Row]:
    """What the mappers must reach, of those that were fitted."""
    rows: list[Row] = []
    for split in SPLITS:
        now = {name: by_split[split].improvement for name, by_split in found.items()}
        rivals = [value for name, value in now.items() if name not in ("auto", FROZEN)]
        if "auto" in now and rivals:
            lead = now["auto"] - max(rivals)
            rows.append(at_least(f"{task}: auto over the best, {split}", lead, _LEAST_OF_AUTO))
        if FROZEN in now and "eb_nonlinear" in now:
            lead = now[FROZEN] - now["eb_nonlinear"]
            rows.append(at_least(f"{task}: frozen over eb, {split}", lead, _LEAST_OVER[task]))
        if FROZEN in now and task == "preview":
            rows.append(at_least(f"{task}: frozen, {split}", now[FROZEN], _LEAST_PREVIEW))
    return rows


def _read_trial(path: Path) -> tuple[FloatArray, FloatArray]:
    """Input and truth, (steps,) each."""
    header = ""
    with path.open() as lines:
        for line in lines:
            if not line.startswith("#"):
                break
            header = line.strip("# \n").rstrip(".")
    names = header.split(",")
    if missing := [name for name in COLUMNS if name not in names]:
        raise InvalidLabels(
            f"{path.name} has the columns {header or 'none'}, without {', '.join(missing)}; it is "
            f"no trial of EmDash00/CPHS2017."
        )
    t_s, reference, label, disturbance = np.loadtxt(
        path, delimiter=",", comments="#", usecols=[names.index(name) for name in COLUMNS], ndmin=2
    ).T
    if not (len(t_s) > 1 and np.allclose(np.diff(t_s) * RATE_HZ, 1.0, atol=0.01)):
        raise InvalidLabels(f"{path.name}: time is not {RATE_HZ:g} Hz throughout; leave it out.")
    return label, holding_input(reference, disturbance, rate_hz=RATE_HZ, gain=GAIN)


def _drive(rollout: str) -> int:
    return int(rollout[1])


def _silent(what: str, share: float) -> None:
    """Fitting takes seconds."""


def _parser() -> ArgumentParser:
    parser = ArgumentParser(prog="benchmarks.people", description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--data", type=Path, required=True, metavar="DIR")
    parser.add_argument("--task", choices=list(TASKS), default="rejection")
    parser.add_argument("--drop", type=int, default=0, metavar="N", help="of the wildest people")
    parser.add_argument("--seeds", type=int, nargs="+", default=[0], metavar="SEED")
    parser.add_argument("--mappers", nargs="+", choices=MAPPERS, default=MAPPERS, metavar="NAME")
    return parser


def main(arguments: list[str]) -> int:
    """Print the table; 1 if a limit is missed, 2 if the data cannot be read."""
    given = _parser().parse_args(arguments)
    try:
        series = read_series(given.data, given.task)
        series, dropped = without_wildest(series, given.drop)
        print(f"{given.task}: {len(by_person(series))} people, {len(series)} trials")
        for one in dropped:
            print(f"  left out, having the largest mean error: {one}")
        if (drives := len(set(drive_names(series).values()))) != DRIVES:
            print(f"  mirror images are not exact: told by their truths there are {drives} drives")
        found = measured(series, given.mappers, given.seeds)
    except SteerlabError as error:
        print(f"benchmarks.people: {error}", file=sys.stderr)
        return 2
    show(found)
    return print_rows(limits(found, given.task))


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
