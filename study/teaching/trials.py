"""Evaluation of what each round left: drives from the same starts, in parts that can be stopped."""

from collections.abc import Sequence

from steerlab.learning.agents.evaluation import evaluate
from steerlab.learning.agents.learner import PolicyLearner
from steerlab.learning.agents.task_env import TaskEnv
from steerlab.learning.policy import Observations
from steerlab.learning.policy_training import Progress, TrainingRows, no_progress
from steerlab.sim.rollout import FloatArray
from steerlab.study.store.teaching import Trial
from steerlab.study.teaching.learning import new_learner
from steerlab.study.teaching.spec import TeachingSpec
from steerlab.study.teaching.teacher_interface import Tick
from steerlab.study.teaching.teaching_log import TeachingLog


def evaluate_policy(
    stage: TaskEnv, subject: TeachingSpec, learner: PolicyLearner, tick: Tick
) -> list[Trial]:
    """How a learner drives now, from every start."""
    watched = _Watched(learner, stage.task.decisions, tick)
    return [
        Trial(start=start, outcome=one.outcome, final_distance_m=one.final_distance_m)
        for start, one in enumerate(evaluate(stage, watched, subject.starts))
    ]


def try_all(stage: TaskEnv, subject: TeachingSpec, register: TeachingLog, tick: Tick) -> None:
    """Try the policies of all rounds that are kept and were not tried yet.

    Raises:
        TeachingError: a policy is missing or was changed.
    """
    tried = register.tried()
    untried = [one for one in register.taught() if one.round not in tried]
    for done, taught in enumerate(untried):
        fresh = new_learner(subject.agent, subject.plan, subject.seed)
        fresh.load(register.load(taught))

        def on_share(share: float, done: int = done) -> None:
            tick((done + share) / len(untried))

        register.keep_trials(taught, evaluate_policy(stage, subject, fresh, on_share))


class _Watched:
    """A learner whose every decision is told to ``tick``, for an evaluation that can be stopped."""

    def __init__(self, learner: PolicyLearner, decisions: int, tick: Tick) -> None:
        self._learner, self._decisions, self._tick = learner, decisions, tick
        self._done = 0

    def act(self, seen: Observations) -> FloatArray:
        """The learner's wheels."""
        self._done += 1
        self._tick(min(1.0, self._done / self._decisions))
        return self._learner.act(seen)

    def doubt(self, seen: Observations) -> FloatArray:
        """The learner's doubt."""
        return self._learner.doubt(seen)

    def train(self, episodes: Sequence[TrainingRows], progress: Progress = no_progress) -> float:
        """As the learner."""
        return self._learner.train(episodes, progress)
