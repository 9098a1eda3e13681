"""The baselines: everything MIND MELD must beat before anything is claimed for it."""

from collections.abc import Callable, Collection, Mapping

from steerlab.learning.baselines.ablations import (
    MeanEmbeddingMapper,
    NoEmbeddingMapper,
    ShuffledEmbeddingMapper,
    TrueStyleMapper,
)
from steerlab.learning.baselines.auto import AutoMapper
from steerlab.learning.baselines.choosing import CANDIDATES, choose
from steerlab.learning.baselines.gain import (
    IdentityMapper,
    PersonGainLagMapper,
    PersonGainMapper,
    SharedGainMapper,
)
from steerlab.learning.baselines.left_out import (
    BASELINES,
    CEILING,
    FULL_ONLY,
    LEAST_RATE_HZ,
    left_out,
)
from steerlab.learning.baselines.no_labels import NoLabelsMapper
from steerlab.learning.baselines.ridge import PersonRidgeMapper, SharedRidgeMapper
from steerlab.learning.empirical_bayes.mapper import EmpiricalBayesMapper
from steerlab.learning.mapper import LabelMapper, MindMeldMapper
from steerlab.learning.presets import PAPER, PAPER_TEXT
from steerlab.learning.pretrained.mapper import SimPretrainedMapper
from steerlab.learning.splits import StudySplit
from steerlab.learning.training_budget import valid_labels, with_enough_steps
from steerlab.sim.progress import ShareProgress
from steerlab.sim.scripted_teacher import TeacherStyle

__all__ = [
    "BASELINES",
    "CEILING",
    "FULL_ONLY",
    "LEAST_RATE_HZ",
    "IdentityMapper",
    "MeanEmbeddingMapper",
    "NoEmbeddingMapper",
    "PersonGainLagMapper",
    "PersonGainMapper",
    "PersonRidgeMapper",
    "SharedGainMapper",
    "SharedRidgeMapper",
    "ShuffledEmbeddingMapper",
    "TrueStyleMapper",
    "fit_baselines",
    "left_out",
]


def fit_baselines(
    mind_meld: MindMeldMapper,
    study: StudySplit,
    *,
    seed: int,
    on_step: ShareProgress,
    without: Collection[str],
    styles: Mapping[str, TeacherStyle] | None = None,
) -> dict[str, LabelMapper]:
    """Every baseline, fitted on the training people and calibrated on the new ones, in order.

    Args:
        mind_meld: fitted and calibrated on ``study``.
        parts: the study; held-out series are not read.
        seed: of the mappers that are trained.
        on_step: told which share of the baselines is fitted, 0 to 1.
        without: baselines not to build: what ``left_out`` finds for ``study``.
        styles: everyone's true style, where the teachers are scripted; without them there is no
            ceiling.
    """
    config, labels = mind_meld.config, valid_labels(study.train_seen)
    fitted: dict[str, LabelMapper] = {}

    def on_epoch(done: int, of: int) -> None:
        on_step((len(fitted) + done / of) / len(wanted))

    builders: dict[str, Callable[[], LabelMapper]] = {
        "identity": IdentityMapper,
        "no_labels": lambda: NoLabelsMapper(config.window),
        "shared_gain": SharedGainMapper,
        "person_gain": PersonGainMapper,
        "person_gain_lag": PersonGainLagMapper,
        "shared_ridge": lambda: SharedRidgeMapper(config.window),
        "person_ridge": lambda: PersonRidgeMapper(config.window),
        "no_embedding": lambda: NoEmbeddingMapper(config, seed=seed, on_epoch=on_epoch),
        "mind_meld_paper": lambda: MindMeldMapper(
            with_enough_steps(PAPER, labels),
            seed=seed,
            on_epoch=on_epoch,
            name="mind_meld_paper",
        ),
        "mind_meld_paper_text": lambda: MindMeldMapper(
            with_enough_steps(PAPER_TEXT, labels),
            seed=seed,
            on_epoch=on_epoch,
            name="mind_meld_paper_text",
        ),
        "eb_nonlinear": EmpiricalBayesMapper,
        "sim_pretrained": lambda: SimPretrainedMapper(seed=seed),
        "sim_pretrained_context": lambda: SimPretrainedMapper(context=True, seed=seed),
    }
    if styles is not None:
        known = styles
        builders[CEILING] = lambda: TrueStyleMapper(known, config, seed=seed, on_epoch=on_epoch)
    wanted = [name for name in builders if name not in without]
    blended = "auto" not in without
    for name in wanted:
        baseline = builders[name]()
        baseline.fit(study.train_seen)
        baseline.calibrate(study.calibrate_new)
        fitted[name] = baseline
        on_step(len(fitted) / len(wanted))
    sharing = (MeanEmbeddingMapper(mind_meld), ShuffledEmbeddingMapper(mind_meld), mind_meld)
    baselines = fitted | {baseline.name: baseline for baseline in sharing}
    if blended:
        anew = builders | {"mind_meld": lambda: MindMeldMapper(config, seed=seed)}
        candidates = {name: anew[name] for name in CANDIDATES if name in baselines}
        baselines["auto"] = AutoMapper(baselines, choose(study.train_seen, candidates, seed=seed))
    return {name: baselines[name] for name in (*BASELINES, CEILING) if name in baselines}
