"""The synthetic experiment: make demonstrators label drives, learn, and score on unseen drives."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from time import perf_counter

import numpy as np

from steerlab.learning.baselines import fit_baselines, left_out
from steerlab.learning.label_quality import LabelQuality, mapper_quality
from steerlab.learning.mapper import MindMeldMapper, stack_embeddings
from steerlab.learning.presets import LAB, MapperConfig
from steerlab.learning.probe import StyleProbe, style_parameters
from steerlab.learning.splits import StudySplit
from steerlab.learning.synthetic.drives import (
    DriveConfig,
    SyntheticDrive,
    label_drives,
    sample_drives,
)
from steerlab.learning.training import TrainingConfig
from steerlab.learning.windows import WindowConfig
from steerlab.sim.arrays import FloatArray
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.populations import sample_population
from steerlab.sim.progress import Progress
from steerlab.sim.scripted_teacher import ScriptedTeacher

# The lab preset with w of 2 dimensions as the paper draws it, and what labels without noise allow:
# a window that just covers the shifts, smaller batches, and a smaller lambda, since labels in wheel
# units are smaller here and lambda weighs them against w. Chosen on seeds 100 and 101.
SYNTHETIC = MapperConfig(
    window=WindowConfig(half_width_s=0.5),
    network=replace(LAB.network, embedding_size=2),
    training=TrainingConfig(
        epochs=60,
        rate=5e-3,
        batch_size=128,
        share_per_epoch=0.25,
        embedding_rate_factor=20.0,
        embedding_loss_weight=1e-3,
        mirror=False,  # not in the paper, and not needed without noise
    ),
)


@dataclass(frozen=True, kw_only=True)
class SyntheticConfig:
    """Numbers of demonstrators and drives. The paper gives none; 34 and 12 are of its study."""

    people: int = 34
    new_people: int = 34
    calibration_tasks: int = 12
    unseen_tasks: int = 6
    seed: int = 0

    def __post_init__(self) -> None:
        least = {
            "people": 6,
            "new_people": 2,
            "calibration_tasks": 1,
            "unseen_tasks": 1,
            "seed": 0,
        }
        for name, smallest in least.items():
            if getattr(self, name) < smallest:
                raise InvalidConfig(
                    f"{name.replace('_', '-')} is {getattr(self, name)}; it must be at least "
                    f"{smallest}."
                )


@dataclass(frozen=True, kw_only=True, eq=False)
class SyntheticResult:
    """The experiment's data, mapper and scores.

    Attributes:
        quality: by split and then method. Splits: ``calibration`` (seen people on the drives that
            trained the mapper), ``unseen`` (seen people on drives that did not) and ``new`` (people
            calibrated with the network frozen, on unseen drives).
        probe_r2, spearman_new: how well w tells ``log_gain`` and ``delay_s``; empty where all
            demonstrators are alike in one of them.
    """

    config: SyntheticConfig
    rate_hz: float
    calibration: tuple[SyntheticDrive, ...]
    unseen: tuple[SyntheticDrive, ...]
    seen_people: list[ScriptedTeacher]
    new_people: list[ScriptedTeacher]
    mapper: MindMeldMapper
    quality: dict[str, dict[str, LabelQuality]]
    left_out: dict[str, str]
    probe_r2: Mapping[str, float]
    spearman_new: Mapping[str, float]
    seconds: dict[str, float]

    def embeddings(self, people: Sequence[ScriptedTeacher]) -> FloatArray:
        """The embeddings of ``people``, (people, 2)."""
        return stack_embeddings(self.mapper, [person.name for person in people])


def run_synthetic(
    config: SyntheticConfig,
    progress: Progress,
    settings: MapperConfig = SYNTHETIC,
) -> SyntheticResult:
    """Run the experiment; the same config gives the same labels and figures."""
    started = perf_counter()
    rate_hz = DriveConfig().rate_hz
    calibration = sample_drives(config.calibration_tasks, config.seed, prefix="calibration")
    unseen = sample_drives(config.unseen_tasks, config.seed, prefix="unseen")
    seen = sample_population("paper", config.people, config.seed, prefix="seen")
    new = sample_population("paper", config.new_people, config.seed, prefix="new")
    train = label_drives(seen, calibration, rate_hz)
    calibrate = label_drives(new, calibration, rate_hz)
    seconds = {"label": perf_counter() - started}

    started = perf_counter()
    mapper = MindMeldMapper(
        settings,
        seed=config.seed,
        on_epoch=lambda done, of: progress("training MIND MELD", done / of),
    )
    mapper.fit(train)
    seconds["fit"] = perf_counter() - started

    started = perf_counter()
    mapper.calibrate(calibrate)
    seconds["calibrate"] = perf_counter() - started

    started = perf_counter()
    progress("scoring", 0.0)
    study = StudySplit(
        train_seen=tuple(train), held_out_seen=(), calibrate_new=tuple(calibrate), held_out_new=()
    )
    without = left_out([study], settings, full=False)
    baselines = fit_baselines(
        mapper,
        study,
        seed=config.seed,
        on_step=lambda share: progress("fitting rival mappers", share),
        without=without,
    )
    quality: dict[str, dict[str, LabelQuality]] = {}
    for split, series in (
        ("calibration", train),
        ("unseen", label_drives(seen, unseen, rate_hz)),
        ("new", label_drives(new, unseen, rate_hz)),
    ):
        quality[split] = {
            name: mapper_quality(baseline, series, np.random.default_rng(config.seed))
            for name, baseline in baselines.items()
        }
    probe_r2, spearman_new = _probe(mapper, seen, new)
    progress("scoring", 1.0)
    seconds["score"] = perf_counter() - started
    return SyntheticResult(
        config=config,
        rate_hz=rate_hz,
        calibration=calibration,
        unseen=unseen,
        seen_people=seen,
        new_people=new,
        mapper=mapper,
        quality=quality,
        left_out=without,
        probe_r2=probe_r2,
        spearman_new=spearman_new,
        seconds=seconds,
    )


def _probe(
    mapper: MindMeldMapper, seen: Sequence[ScriptedTeacher], new: Sequence[ScriptedTeacher]
) -> tuple[Mapping[str, float], Mapping[str, float]]:
    styles = {
        "seen": style_parameters([person.style for person in seen]),
        "new": style_parameters([person.style for person in new]),
    }
    if any(np.ptp(values) == 0.0 for of in styles.values() for values in of.values()):
        return {}, {}
    probe = StyleProbe.fit(
        stack_embeddings(mapper, [person.name for person in seen]), styles["seen"]
    )
    embeddings = stack_embeddings(mapper, [person.name for person in new])
    return probe.probe_r2, probe.spearman_new(embeddings, styles["new"])
