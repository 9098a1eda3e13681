"""Every interactive learner, its source, and the name that the command line and reports use.

Each is a gate (``gates.py``), a label rule (``label_rules.py``) and, for some, a doubt
(``learner.py``). Where one departs from its paper, its docstring says so.
"""

from collections.abc import Callable, Mapping

from steerlab.learning.agents.contract import Agent
from steerlab.learning.agents.gates import (
    BetaMixture,
    DoubtGate,
    EnsembleGate,
    LearnerDrives,
    RiskGate,
    TeacherDrives,
)
from steerlab.learning.agents.label_rules import (
    LAMBDA,
    CoachedLabels,
    DemonstrationsAndCorrections,
    EveryLabel,
    InterventionLabels,
    MappedLabels,
    NovelLabels,
    OracleLabelRule,
    WhereTeacherDrives,
)
from steerlab.learning.baselines.left_out import BASELINES, CEILING
from steerlab.learning.mapper import LabelMapper
from steerlab.sim.errors import InvalidConfig

ENSEMBLE_MEMBERS = 3


def bc() -> Agent:
    """Behavioural cloning: the teacher drives in each round, and the learner imitates.

    Pomerleau, "ALVINN", NeurIPS 1988; the paper's human-centric condition.
    """
    return Agent(name="bc", gate=TeacherDrives(), rule=WhereTeacherDrives())


def dagger() -> Agent:
    """DAgger: the learner drives, the teacher labels where it went, all data are kept.

    Ross, Gordon & Bagnell, "A reduction of imitation learning and structured prediction to
    no-regret online learning", AISTATS 2011, with the paper's parameter-free choice: beta_i, the
    probability that the teacher holds the wheel in round i, is 0 after the demonstration.
    """
    return Agent(name="dagger", gate=LearnerDrives(), rule=EveryLabel())


def dagger_beta() -> Agent:
    """DAgger with beta_i = 0.5^i."""
    return Agent(name="dagger-beta", gate=BetaMixture(), rule=EveryLabel())


def hg_dagger() -> Agent:
    """HG-DAgger: the human decides when to take the wheel, and only what they did then is learned.

    Kelly et al., "HG-DAgger: interactive imitation learning with human experts", ICRA 2019.
    Departures: the paper learns a doubt threshold from takeovers for use after training, which
    nothing here needs; labels of a person at the wheel are those of a driver, and never mapped.
    """
    return Agent(name="hg-dagger", gate=RiskGate(), rule=WhereTeacherDrives())


def safe_dagger() -> Agent:
    """SafeDAgger: a second model predicts whether the learner strays from the teacher, and decides.

    Zhang & Cho, "Query-efficient imitation learning for end-to-end autonomous driving", AAAI 2017.
    Where the safety model says unsafe, the teacher drives and the step is learned. The safety
    model learns from the errors that the policy made on the teacher's rows *before* it learned
    them. Departures: a logistic regression on the policy's own features stands for the paper's
    safety network, refitted each round; until it has seen both kinds, everything is unsafe.
    """
    return Agent(name="safe-dagger", gate=DoubtGate(), rule=WhereTeacherDrives(), doubts="safety")


def ensemble_dagger() -> Agent:
    """EnsembleDAgger: the learner drives while its policies agree and are near the teacher's wheel.

    Menda, Driggs-Campbell & Kochenderfer, "EnsembleDAgger: a Bayesian approach to safe imitation
    learning", IROS 2019. Doubt is the spread of the policies, 1 at ``learner.SPREAD_WHEEL``.
    Departures: three policies that differ in weights and batches (the paper uses ten); only what
    the teacher did with the wheel in hand is learned, so a round costs what it asks.
    """
    return Agent(
        name="ensemble-dagger",
        gate=EnsembleGate(),
        rule=WhereTeacherDrives(),
        ensemble=ENSEMBLE_MEMBERS,
        doubts="spread",
    )


def eil() -> Agent:
    """EIL: learn from when the expert steps in, and also from when they do not.

    Spencer et al., "Learning from interventions: human-robot interaction as both explicit and
    implicit feedback", RSS 2020 ("Expert intervention learning", Autonomous Robots 2022). The gate is
    HG-DAgger's. Where the teacher drove, imitate; where the learner drove undisturbed it was good
    enough; just before a takeover it was not. Departure: the paper learns a value function with hinge costs
    over actions; here the hinge before a takeover is made linear at the moment of collection: the
    target lies ``MARGIN`` away from the learner's action, on the side the teacher then turned to.
    """
    return Agent(name="eil", gate=RiskGate(), rule=InterventionLabels())


def coaching(weight: float = LAMBDA) -> Agent:
    """Imitation by coaching: at first ask for what the learner can nearly do, then for more.

    He, Daumé & Eisner, "Imitation learning by coaching", NeurIPS 2012. The hope action maximises
    lambda_i times the learner's score plus the task's reward; with squared losses that is a
    weighted mean of the learner's action and the teacher's label. lambda_i fades by ``FADE`` each
    round, so the last rounds are DAgger; lambda 0 is DAgger from the start.
    """
    return Agent(name="coaching", gate=LearnerDrives(), rule=CoachedLabels(weight))


def shiv() -> Agent:
    """SHIV: ask for labels only where the learner is new to what it sees.

    Laskey et al., "SHIV: reducing supervisor burden in DAgger using support vectors for query
    efficient learning in high dimensional state spaces", ICRA 2016. As there, what the policy
    still gets wrong after training counts as unknown, so labels are asked for near it too.
    Departure: one class is told by distance to the nearest row that was learnt, among the policy's
    own features (``learner.Novelty``), where the paper fits a one-class SVM.
    """
    return Agent(name="shiv", gate=LearnerDrives(), rule=NovelLabels(), doubts="risk")


def confidence_based_autonomy() -> Agent:
    """Confidence-based autonomy: the learner asks where it is unsure; mistakes are corrected.

    Chernova & Veloso, "Interactive policy learning through confidence-based autonomy", JAIR 2009.
    Confident execution: below the confidence threshold the teacher drives. Corrective
    demonstration: where the learner was confident and wrong, the teacher, who watches, gives the
    right wheel. Departures: the paper classifies actions and thresholds a classifier's confidence
    and the distance to the nearest neighbour; here the distance alone (``learner.Novelty``), and a
    mistake is a wheel more than ``MISTAKE_WHEEL`` from the teacher's feedback.
    """
    return Agent(
        name="confidence", gate=DoubtGate(), rule=DemonstrationsAndCorrections(), doubts="novelty"
    )


def oracle() -> Agent:
    """Oracle-DAgger: DAgger with ground-truth labels throughout; a reference, not a method."""
    return Agent(
        name="oracle", gate=LearnerDrives(), rule=OracleLabelRule(), demonstration_is_oracle=True
    )


def mapped(name: str, mapper: LabelMapper) -> Agent:
    """DAgger on mapped labels; with MIND MELD as the mapper, the paper's Algorithm 1.

    The demonstration stays as it was driven: w describes how someone corrects a drive, not how
    they drive.

    Args:
        name: ``mind-meld``, ``mind-meld-mean`` or ``mapped:<baseline>``.
    """
    return Agent(name=name, gate=LearnerDrives(), rule=MappedLabels(mapper))


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
        mappers: by baseline, fitted, and calibrated on the person who will teach.

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
