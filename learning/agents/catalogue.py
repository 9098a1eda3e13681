"""Every learner by the name that the command line and ``summary.json`` use."""

from collections.abc import Callable, Mapping

from steerlab.learning.agents.bc import bc
from steerlab.learning.agents.coaching import coaching
from steerlab.learning.agents.confidence import confidence_based_autonomy
from steerlab.learning.agents.contract import Agent
from steerlab.learning.agents.dagger import dagger, dagger_beta
from steerlab.learning.agents.eil import eil
from steerlab.learning.agents.ensemble_dagger import ensemble_dagger
from steerlab.learning.agents.hg_dagger import hg_dagger
from steerlab.learning.agents.mind_meld import mapped
from steerlab.learning.agents.oracle import oracle
from steerlab.learning.agents.safe_dagger import safe_dagger
from steerlab.learning.agents.shiv import shiv
from steerlab.learning.baselines.names import BASELINES, CEILING
from steerlab.learning.mapper import LabelMapper
from steerlab.sim.errors import InvalidConfig

PLAIN: Mapping[str, Callable[[], Agent]] = {
    "bc": bc,
    "dagger": dagger,
    "dagger-beta": dagger_beta,
    "hg-dagger": hg_dagger,
    "safe-dagger": safe_dagger,
    "ensemble-dagger": ensemble_dagger,
    "eil": eil,
    "coaching": coaching,
    "shiv": shiv,
    "confidence": confidence_based_autonomy,
    "oracle": oracle,
}
"""Learners that map no labels."""

MAPPED = {"mind-meld": "mind_meld", "mind-meld-mean": "mean_embedding"}
"""Learners that do, and the baseline that maps for them."""

PREFIX = "mapped:"
MAPPED_BASELINES = tuple(
    baseline for baseline in (*BASELINES, CEILING) if baseline not in MAPPED.values()
)
LEARNERS = (
    "bc",
    "dagger",
    "dagger-beta",
    "mind-meld",
    "mind-meld-mean",
    "oracle",
    "hg-dagger",
    "safe-dagger",
    "ensemble-dagger",
    "eil",
    "coaching",
    "shiv",
    "confidence",
    *(PREFIX + baseline for baseline in MAPPED_BASELINES),
)
"""Every valid name."""


def baseline_of(name: str) -> str | None:
    """The baseline that maps this learner's labels; None if none does.

    Raises:
        InvalidConfig: there is no such learner.
    """
    if name not in LEARNERS:
        raise InvalidConfig(f"No learner {name!r}; choose from {', '.join(LEARNERS)}.")
    return MAPPED.get(name, name.removeprefix(PREFIX) if name.startswith(PREFIX) else None)


def make_agent(name: str, mappers: Mapping[str, LabelMapper]) -> Agent:
    """A fresh condition; gates keep state, so one serves one teacher and seed.

    Args:
        mappers: by baseline, fitted and calibrated on whoever will teach.

    Raises:
        InvalidConfig: there is no such learner, or its mapper was not given.
    """
    baseline = baseline_of(name)
    if baseline is None:
        return PLAIN[name]()
    if baseline not in mappers:
        raise InvalidConfig(
            f"Learner {name!r} needs the mapper {baseline!r}; fitted are {', '.join(mappers) or 'none'}."
        )
    return mapped(name, mappers[baseline])
