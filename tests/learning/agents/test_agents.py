"""Each learner against a property its paper claims, on made-up episodes: no simulator, no camera."""

import numpy as np
import pytest

from steerlab.learning.agents import LEARNERS, Episode, PolicyLearner, make_agent
from steerlab.learning.agents.catalogue import PLAIN, baseline_of
from steerlab.learning.agents.contract import GateInput, Targets
from steerlab.learning.agents.gates import LEAST_HELD, BetaMixture, EnsembleGate, RiskGate
from steerlab.learning.agents.label_rules import (
    BAD_DECISIONS,
    MARGIN,
    CoachedLabels,
    DemonstrationsAndCorrections,
    EveryLabel,
    InterventionLabels,
    MappedLabels,
    NovelLabels,
    OracleLabelRule,
    WhereTeacherDrives,
    feedback_series,
)
from steerlab.learning.agents.learner import Novelty, SafetyModel
from steerlab.learning.baselines import IdentityMapper
from steerlab.learning.policy import IMAGE_SHAPE, Observations
from steerlab.learning.policy_training import PolicyTrainingConfig, TrainingRows
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.records import Driver

DECISIONS = 30


class Doubting:
    """A learner that does nothing but doubt as it is told."""

    def __init__(self, doubt):
        self._doubt = doubt

    def act(self, seen):
        return np.zeros(len(seen))

    def doubt(self, seen):
        return self._doubt

    def train(self, episodes):
        return 0.0


@pytest.fixture
def make_episode(make_rollout):
    def make(*, taught=None, truth=0.4, round_number=1, seed=0) -> Episode:
        rng = np.random.default_rng(seed)
        steps = 2 * DECISIONS
        rows = np.arange(0, steps, 2)
        taught = np.zeros(DECISIONS, dtype=bool) if taught is None else taught
        oracle = np.full(steps, truth)
        return Episode(
            rollout=make_rollout(oracle),
            feedback=oracle + 0.3,
            live=np.where(np.repeat(taught, 2), 0.2, np.nan),
            teacher_drives=taught,
            seen=Observations(
                rng.integers(0, 255, (DECISIONS, *IMAGE_SHAPE), dtype=np.uint8),
                np.zeros((DECISIONS, 5), np.float32),
            ),
            rows=rows,
            learner_wheel=np.full(DECISIONS, -0.5),
            round_number=round_number,
            person="one",
        )

    return make


def _moment(held=Driver.ROBOT, learner=0.0, teacher=0.0, oracle=0.0, doubt=0.0) -> GateInput:
    return GateInput(0, held, learner, teacher, oracle, doubt)


def _takeover() -> np.ndarray:
    taught = np.zeros(DECISIONS, dtype=bool)
    taught[12:20] = True
    return taught


@pytest.mark.parametrize("name", [name for name in LEARNERS if baseline_of(name) is None])
def test_every_plain_learner_keeps_the_contract(name, make_episode):
    agent = make_agent(name, {})
    episode = make_episode(taught=_takeover())
    agent.gate.begin(1, np.random.default_rng(0))
    moment = _moment(doubt=0.5)
    assert agent.gate.who_drives(moment) in (Driver.ROBOT, Driver.TEACHER)
    found = agent.rule.target(episode, Doubting(np.full(DECISIONS, 2.0)))
    assert found.target.shape == found.weight.shape == found.asked.shape == (DECISIONS,)
    assert (found.weight >= 0.0).all()
    assert agent.name == name


def test_an_unknown_learner_lists_the_valid_ones():
    with pytest.raises(InvalidConfig) as error:
        make_agent("daggre", {})
    for name in ("daggre", "dagger", "mind-meld", "mapped:sim_pretrained"):
        assert name in str(error.value)


def test_a_learner_without_its_mapper_says_so():
    with pytest.raises(InvalidConfig, match="needs the mapper 'mind_meld'"):
        make_agent("mind-meld", {})


def test_bc_learns_what_was_driven(make_episode):
    everything = np.ones(DECISIONS, dtype=bool)
    found = PLAIN["bc"]().rule.target(make_episode(taught=everything), Doubting(None))
    assert found.asked.all()
    assert found.target == pytest.approx(np.full(DECISIONS, 0.2))


def test_dagger_labels_every_step_of_the_learners_drive(make_episode):
    found = PLAIN["dagger"]().rule.target(make_episode(), Doubting(None))
    assert found.asked.all()
    assert found.target == pytest.approx(np.full(DECISIONS, 0.7))


@pytest.mark.parametrize("name", ["dagger", "coaching", "shiv", "oracle"])
def test_these_leave_the_wheel_to_the_learner(name):
    gate = PLAIN[name]().gate
    gate.begin(1, np.random.default_rng(0))
    far_off = _moment(learner=2.0, teacher=-2.0, oracle=-2.0, doubt=5.0)
    assert gate.who_drives(far_off) is Driver.ROBOT


def test_beta_falls_with_the_rounds():
    gate = BetaMixture(0.5)
    shares = []
    for number in (1, 4):
        gate.begin(number, np.random.default_rng(0))
        drives = [gate.who_drives(_moment()) is Driver.TEACHER for _ in range(2000)]
        shares.append(np.mean(drives))
    assert shares == pytest.approx([0.5, 0.0625], abs=0.04)


def test_the_oracle_leaves_out_where_there_is_no_way(make_episode):
    episode = make_episode()
    episode.rollout.oracle_label[:10] = np.nan
    found = OracleLabelRule().target(episode, Doubting(None))
    assert (found.weight == np.r_[np.zeros(5), np.ones(DECISIONS - 5)]).all()


def test_mapped_by_identity_is_dagger_and_the_truth_stays_hidden(make_episode):
    episode = make_episode()
    found = MappedLabels(IdentityMapper()).target(episode, Doubting(None))
    assert found.target == pytest.approx(EveryLabel().target(episode, Doubting(None)).target)
    assert np.isnan(feedback_series(episode).truth).all()


@pytest.mark.parametrize("name", ["hg-dagger", "ensemble-dagger", "safe-dagger"])
def test_gated_learners_learn_from_takeovers_only(name, make_episode):
    found = PLAIN[name]().rule.target(make_episode(taught=_takeover()), Doubting(None))
    assert found.target[_takeover()] == pytest.approx(0.2)  # what was driven, not what was labelled
    assert (found.asked == _takeover()).all()
    assert ((found.weight > 0.0) == _takeover()).all()


def test_hg_gate_takes_holds_and_gives_back():
    gate = PLAIN["hg-dagger"]().gate
    assert isinstance(gate, RiskGate)
    gate.begin(1, np.random.default_rng(0))
    held, who = Driver.ROBOT, []
    for error in [0.0] * 5 + [2.0] * 5 + [0.0] * 20:
        held = gate.who_drives(_moment(held=held, learner=error))
        who.append(held is Driver.TEACHER)
    first = who.index(True)
    assert 5 <= first < 8
    assert all(who[first : first + LEAST_HELD])
    assert not any(who[-5:])


def test_hg_gate_without_danger_asks_nothing(make_episode):
    found = WhereTeacherDrives().target(make_episode(), Doubting(None))
    assert found.rows(make_episode().seen) is None


def test_eil_pushes_away_from_what_led_to_a_takeover(make_episode):
    found = InterventionLabels().target(make_episode(taught=_takeover()), Doubting(None))
    before = slice(12 - BAD_DECISIONS, 12)
    assert found.target[before] == pytest.approx(-0.5 + MARGIN)  # the teacher then turned left
    assert found.target[:5] == pytest.approx(-0.5)  # good enough
    assert found.weight[12] > found.weight[11] > found.weight[0] > 0.0
    assert (found.asked == _takeover()).all()


def test_coaching_at_lambda_0_is_dagger_and_fades_to_it(make_episode):
    dagger = EveryLabel().target(make_episode(), Doubting(None)).target
    assert CoachedLabels(0.0).target(make_episode(), Doubting(None)).target == pytest.approx(dagger)
    first = CoachedLabels(1.0).target(make_episode(round_number=1), Doubting(None)).target
    assert first == pytest.approx(0.5 * (dagger - 0.5))  # half-way to the learner's -0.5
    late = CoachedLabels(1.0).target(make_episode(round_number=12), Doubting(None)).target
    assert np.abs(late - dagger).max() < 0.1 * np.abs(first - dagger).max()


def test_shiv_asks_only_where_it_is_new(make_episode):
    doubt = np.where(np.arange(DECISIONS) < 10, 2.0, 0.5)
    found = NovelLabels().target(make_episode(), Doubting(doubt))
    assert (found.asked == (doubt > 1.0)).all()
    assert found.rows(make_episode().seen).target == pytest.approx(np.full(10, 0.7))


def test_confidence_adds_corrections_of_confident_mistakes(make_episode):
    episode = make_episode(taught=_takeover())
    episode.feedback[:10] = 1.5  # 2.0 from what the learner did
    episode.feedback[10:] = -0.4
    found = DemonstrationsAndCorrections().target(episode, Doubting(None))
    assert found.asked[:5].all()
    assert (found.asked[5:] == _takeover()[5:]).all()


def test_ensemble_dagger_asks_less_as_doubt_falls():
    gate = EnsembleGate()
    spread = np.linspace(0.0, 3.0, 50)
    shares = [
        np.mean([gate.who_drives(_moment(doubt=d * scale)) is Driver.TEACHER for d in spread])
        for scale in (1.0, 0.5, 0.1)
    ]
    assert shares[0] > shares[1] > shares[2]
    assert gate.who_drives(_moment(learner=1.5, doubt=0.0)) is Driver.TEACHER  # too far apart


def test_ensemble_dagger_has_an_ensemble_to_doubt_with():
    agent = PLAIN["ensemble-dagger"]()
    assert (agent.ensemble, agent.doubts) == (3, "spread")


def test_safe_dagger_reads_its_safety_model_and_nothing_of_the_teacher():
    agent = PLAIN["safe-dagger"]()
    assert agent.doubts == "safety"
    far_off = _moment(learner=2.0, teacher=-2.0, oracle=-2.0, doubt=0.5)
    assert agent.gate.who_drives(far_off) is Driver.ROBOT
    assert agent.gate.who_drives(_moment(doubt=1.5)) is Driver.TEACHER


def test_safe_dagger_asks_less_of_what_it_can_do(make_episode):
    """Its second look at the same drive: the errors before learning have become small."""
    episode = make_episode()
    rows = TrainingRows(episode.seen, np.full(DECISIONS, 2.0), np.ones(DECISIONS))
    learner = PolicyLearner(0, doubts="safety", training=PolicyTrainingConfig(steps=40))
    assert np.isinf(learner.doubt(episode.seen)).all()
    shares = []
    for count in (1, 2, 3):
        learner.train([rows] * count)
        shares.append((learner.doubt(episode.seen) > 1.0).mean())
    assert shares[0] == 1.0
    assert shares[-1] < 0.5


def test_mind_meld_maps_with_w_and_its_control_without():
    assert baseline_of("mind-meld") == "mind_meld"
    assert baseline_of("mind-meld-mean") == "mean_embedding"
    assert baseline_of("mapped:person_ridge") == "person_ridge"
    identity = IdentityMapper()
    assert isinstance(make_agent("mind-meld", {"mind_meld": identity}).rule, MappedLabels)


def _walk(rng: np.random.Generator, rows: int = 100) -> np.ndarray:
    """Features of a drive: each decision's differ a little from the last one's."""
    return 0.1 * rng.normal(size=(rows, 4)).cumsum(axis=0)


def test_novelty_falls_once_a_place_is_known():
    rng = np.random.default_rng(0)
    here = _walk(rng)
    there = _walk(rng) + 20.0
    knows_here = Novelty([here])
    assert (knows_here(here) == 0.0).all()
    between = knows_here(0.5 * (here[1:] + here[:-1]))
    assert (between <= 1.0).mean() > 0.95  # but for a step of twice the usual length
    assert (knows_here(there) > 1.0).all()
    assert (Novelty([here, there])(there) == 0.0).all()


def test_odd_drives_make_nothing_else_known():
    rng = np.random.default_rng(2)
    here, new = _walk(rng), _walk(rng) + 9.0
    odd = [_walk(rng) + far for far in (-30.0, 30.0, 60.0)]
    knows = Novelty([here, *odd])
    assert (knows(new) > 1.0).all()


def test_what_was_not_learnt_is_not_known():
    rng = np.random.default_rng(1)
    here = _walk(rng)
    learnt = np.arange(100) < 50
    novelty = Novelty([here], [learnt])
    assert (novelty(here)[:50] == 0.0).all()
    assert (novelty(here)[60:] > 1.0).mean() > 0.8
    assert np.isinf(Novelty([here], [~np.ones(100, bool)])(here)).all()
    assert np.isinf(Novelty([here[:1]])(here)).all()  # one decision tells nothing of change


def test_shiv_asks_again_where_it_did_not_learn(make_episode):
    """Laskey et al.: what the policy misfits counts as risky, however often it was seen."""
    seen = make_episode().seen
    blank = Observations(np.zeros_like(seen.image), np.zeros_like(seen.motion))
    shares = {}
    for name, views, target in (
        ("learnt", seen, np.full(DECISIONS, 1.0)),
        ("not to be learnt", blank, np.where(np.arange(DECISIONS) % 2, 2.0, -2.0)),
    ):
        learner = PolicyLearner(0, doubts="risk", training=PolicyTrainingConfig(steps=60))
        assert np.isinf(learner.doubt(views)).all()
        learner.train([TrainingRows(views, target, np.ones(DECISIONS))])
        shares[name] = (learner.doubt(views) > 1.0).mean()
    assert shares == {"learnt": 0.0, "not to be learnt": 1.0}


def test_the_safety_model_separates_what_it_was_shown():
    rng = np.random.default_rng(1)
    features = rng.normal(size=(300, 5))
    error = np.where(features[:, 0] > 0.0, 1.0, 0.1)
    odds = SafetyModel(features, error)(features)
    assert ((odds > 1.0) == (error > 0.5)).mean() > 0.95
    assert np.isinf(SafetyModel(features, np.ones(300))(features)).all()
    assert (SafetyModel(features, np.zeros(300))(features) == 0.0).all()


def test_a_learner_repeats_by_its_seed_and_its_spread_falls_where_it_learned(make_episode):
    episode = make_episode()
    rows = TrainingRows(episode.seen, np.sin(np.arange(DECISIONS)), np.ones(DECISIONS))
    config = PolicyTrainingConfig(steps=60)

    def learner(seed):
        made = PolicyLearner(seed, members=2, doubts="spread", training=config)
        before = made.doubt(episode.seen)
        made.train([rows])
        return made, before

    (one, before), (same, _), (other, _) = learner(3), learner(3), learner(4)
    assert (one.act(episode.seen) == same.act(episode.seen)).all()
    assert (one.act(episode.seen) != other.act(episode.seen)).any()
    assert before.shape == (DECISIONS,)
    members = np.abs(one.act(episode.seen) - rows.target).mean()
    assert members < 0.3


def test_targets_that_are_not_finite_need_weight_0():
    bad = np.array([np.nan, 1.0])
    with pytest.raises(ValueError, match="not finite"):
        Targets(bad, np.ones(2), np.ones(2, dtype=bool))


def test_a_learner_that_takes_over_weights_acts_by_them(make_episode):
    seen = make_episode().seen
    mine, other = PolicyLearner(0), PolicyLearner(1)
    assert (mine.act(seen) != other.act(seen)).any()
    mine.load(other.networks)
    assert (mine.act(seen) == other.act(seen)).all()
