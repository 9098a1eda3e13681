"""The ladder: everything MIND MELD must beat before anything is claimed for it."""

from collections.abc import Callable, Mapping

from steerlab.learning.ladder.gain import PersonGainMapper, SharedGainMapper
from steerlab.learning.ladder.gain_lag import PersonGainLagMapper
from steerlab.learning.ladder.given_embedding import NoEmbeddingMapper, TrueStyleMapper
from steerlab.learning.ladder.identity import IdentityMapper
from steerlab.learning.ladder.other_embedding import MeanEmbeddingMapper, ShuffledEmbeddingMapper
from steerlab.learning.ladder.ridge import PersonRidgeMapper, SharedRidgeMapper
from steerlab.learning.mapper import LabelMapper, MindMeldMapper
from steerlab.learning.presets import PAPER
from steerlab.learning.splits import StudySplit
from steerlab.sim.scripted_teacher import TeacherStyle

__all__ = [
    "CEILING",
    "LADDER",
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
    "build_ladder",
]

LADDER = (
    "identity",
    "shared_gain",
    "person_gain",
    "person_gain_lag",
    "shared_ridge",
    "person_ridge",
    "no_embedding",
    "mean_embedding",
    "shuffled_embedding",
    "mind_meld_paper",
    "mind_meld",
)
"""Every rung; a quick ladder lacks ``no_embedding`` and ``mind_meld_paper``."""

CEILING = "true_style"
"""Told the teachers' true styles: a reference, not a method."""


def build_ladder(
    mind_meld: MindMeldMapper,
    parts: StudySplit,
    *,
    seed: int,
    on_step: Callable[[str, float], None],
    full: bool = True,
    styles: Mapping[str, TeacherStyle] | None = None,
) -> dict[str, LabelMapper]:
    """Every rung, fitted on the training people and calibrated on the new ones.

    Args:
        mind_meld: fitted and calibrated on ``parts``.
        parts: the study; held-out series are not read.
        seed: of whatever is trained.
        on_step: told which rung is being trained, and which share of it is done.
        full: also train ``no_embedding``, ``mind_meld_paper`` (unless ``mind_meld`` is that
            already) and, with ``styles``, the ceiling; minutes instead of seconds.
        styles: everyone's true style, where the teachers are scripted.
    """

    def told(rung: str) -> Callable[[int, int], None]:
        return lambda done, of: on_step(f"training {rung.replace('_', ' ')}", done / of)

    rungs: list[LabelMapper] = [
        IdentityMapper(),
        SharedGainMapper(),
        PersonGainMapper(),
        PersonGainLagMapper(),
        SharedRidgeMapper(mind_meld.config.window),
        PersonRidgeMapper(mind_meld.config.window),
    ]
    if full:
        rungs.append(NoEmbeddingMapper(mind_meld.config, seed=seed, on_epoch=told("no_embedding")))
        if mind_meld.config != PAPER:
            name = "mind_meld_paper"
            rungs.append(MindMeldMapper(PAPER, seed=seed, on_epoch=told(name), name=name))
        if styles is not None:
            rungs.append(
                TrueStyleMapper(styles, mind_meld.config, seed=seed, on_epoch=told(CEILING))
            )
    for rung in rungs:
        rung.fit(parts.train_seen)
        rung.calibrate(parts.calibrate_new)
    rungs += [MeanEmbeddingMapper(mind_meld), ShuffledEmbeddingMapper(mind_meld), mind_meld]
    by_name = {rung.name: rung for rung in rungs}
    return {name: by_name[name] for name in (*LADDER, CEILING) if name in by_name}
