"""An analysis: how long does it take, and does it find nothing where there is nothing?

``python -m benchmarks.analysis``: 34 people of whom everything is known but the network, then 1,000
studies in which w, answers, styles, label errors and conditions have nothing to do with each other.
"""

import tempfile
from dataclasses import replace
from math import sqrt
from pathlib import Path
from time import perf_counter

import numpy as np

from benchmarks.mapper_quality import label_all
from benchmarks.rows import Row, at_most, print_rows
from steerlab.analysis.study_data.networks import embeddings_of, judge, network_for
from steerlab.analysis.study_data.records import (
    ConditionValue,
    Embeddings,
    HeldOut,
    Person,
    StudyData,
)
from steerlab.analysis.study_tables.conditions import conditions
from steerlab.analysis.study_tables.constructs import DEFAULT_STYLES, Construct, Topic
from steerlab.analysis.study_tables.hypotheses import hypotheses
from steerlab.analysis.study_tables.paper_tables import table2
from steerlab.analysis.study_tables.report import AnalysisReport, render_analysis
from steerlab.analysis.study_tables.tables import AnalysisConfig, analyse, exact_styles
from steerlab.learning.presets import LAB
from steerlab.learning.splits import split_rollouts, split_study
from steerlab.sim.calibration_set import load_calibration_set
from steerlab.sim.populations import sample_population
from steerlab.study.scripted_answers import ScriptedRespondent
from steerlab.study.surveys.questionnaire_file import shipped_questionnaires

PEOPLE, WOMEN, SEED = 34, 10, 61
STUDIES, PERMUTATIONS, ALPHA = 1000, 499, 0.05  # Holm over eleven tests needs p below .0045
LIMIT = ALPHA + 3.0 * sqrt(ALPHA * (1.0 - ALPHA) / STUDIES)
ASKED = (
    *("demographics", "experience_games", "experience_sim_driving"),
    *("experience_driving", "trust", "mini_ipip_5"),
)
_TOPICS: tuple[Topic, ...] = (
    *("games", "driving", "driving", "trust"),
    *("personality", "personality", "personality", "personality", "personality"),
)


def run() -> list[Row]:
    """How long 34 people take, the network that is judged included."""
    data = _study()
    exact_styles(data)  # compiles
    with tempfile.TemporaryDirectory() as cache:
        started = perf_counter()
        rollouts = [rollout.name for rollout in load_calibration_set()]
        split = split_rollouts(rollouts)
        parts = split_study(data.series, split, ())
        mapper = network_for(
            parts, LAB, seed=0, cache=Path(cache), progress=lambda what, share: None
        )
        trained_s = perf_counter() - started
    people = [one.id for one in data.people]
    w = embeddings_of(mapper, people, seed=0, source="benchmark", held_out=split.held_out)
    held_out = judge(mapper, parts.held_out_seen, seed=0, role="training")
    assert w is not None
    assert held_out is not None
    data = replace(data, embeddings=(w,), held_out=(held_out,))
    started = perf_counter()
    exact_styles(data)
    warped_s = perf_counter() - started
    started = perf_counter()
    analysis = analyse(data, AnalysisConfig())
    render_analysis(
        AnalysisReport(analysis=analysis, versions={}, seconds={}, command="", files=())
    )
    tables_s = perf_counter() - started
    return [
        at_most(f"{PEOPLE} people: network and analysis", trained_s + tables_s, 20.0, "s"),
        at_most(f"{PEOPLE} people: tables and page", tables_s, 10.0, "s"),
        at_most(f"{PEOPLE} people: exact DTW", warped_s, 5.0, "s"),
    ]


def quality() -> list[Row]:
    """Share of null studies in which each test rejects, and any primary hypothesis is supported."""
    rejected: dict[str, int] = {}
    for number in range(STUDIES):
        rng = np.random.default_rng([SEED, number])
        data, constructs = _null_study(rng)
        of_w = table2(data, constructs, seed=number, permutations=PERMUTATIONS)
        compared = conditions(data, seed=number)
        found = hypotheses(data, of_w, compared, DEFAULT_STYLES)
        tests = {row["id"]: row["p"] <= ALPHA for row in found}
        success = compared["metrics"]["success"]
        tests |= {
            "gender, Hotelling": of_w["gender"]["primary"]["p"] <= ALPHA,
            "conditions, Friedman": success["friedman"]["p"] < ALPHA,
            "conditions, repeated measures": success["repeated_measures"]["p"] < ALPHA,
            "any of Table 2, Holm": any(
                row["holm"] < ALPHA for row in of_w["rows"] if row["family"]
            ),
            "any primary hypothesis supported": any(
                row["verdict"] == "supported" for row in found if row["primary"]
            ),
        }
        for name, one in tests.items():
            rejected[name] = rejected.get(name, 0) + int(one)
    return [
        at_most(f"null studies: {name}", count / STUDIES, LIMIT) for name, count in rejected.items()
    ]


def _study() -> StudyData:
    """Scripted people with labels and answers."""
    teachers = sample_population("human", PEOPLE, SEED, prefix="bench")
    known = shipped_questionnaires()
    asked = {key: known[key] for key in ASKED}
    people = tuple(
        Person(
            id=one.name,
            role="training",
            answers={
                key: ScriptedRespondent(one.name, one.style, SEED).answers(questionnaire)
                for key, questionnaire in asked.items()
            },
        )
        for one in teachers
    )
    return StudyData(
        kind="study",
        title="Benchmark",
        simulated=True,
        people=people,
        series=tuple(label_all(teachers, load_calibration_set())),
        questionnaires=asked,
        enrolled=PEOPLE,
    )


def _null_study(rng: np.random.Generator) -> tuple[StudyData, list[Construct]]:
    names = tuple(f"p{number:02d}" for number in range(PEOPLE))
    people = tuple(
        Person(
            id=name,
            role="training",
            answers={"demographics": {"gender": "woman" if row < WOMEN else "man"}},
        )
        for row, name in enumerate(names)
    )
    w = rng.standard_exponential((PEOPLE, 4)) @ rng.standard_normal((4, 4))
    errors = rng.lognormal(-0.7, 0.4, (2, PEOPLE)) * rng.lognormal(0.0, 0.3, PEOPLE)

    def construct(key: str, topic: Topic) -> Construct:
        return Construct(
            key=key,
            title=key,
            topic=topic,
            family=True,
            people=names,
            values=rng.integers(4, 21, PEOPLE).astype(np.float64)
            if topic not in ("amplitude", "timing")
            else rng.standard_t(4, PEOPLE),
            missing={},
        )

    constructs = [construct(f"scale {row}", topic) for row, topic in enumerate(_TOPICS)]
    constructs += [
        construct(DEFAULT_STYLES["H3a"], "amplitude"),
        construct(DEFAULT_STYLES["H3b"], "timing"),
    ]
    skill = rng.normal(0.5, 0.15, PEOPLE)
    outcomes = tuple(
        ConditionValue(
            person=name,
            condition=condition,
            metric="success",
            value=float(rng.binomial(10, np.clip(skill[row], 0.02, 0.98)) / 10.0),
            position=place,
        )
        for row, name in enumerate(names)
        for place, condition in enumerate(rng.permutation(["mind_meld", "bc", "dagger"]).tolist())
    )
    data = StudyData(
        kind="study",
        title="Null",
        simulated=True,
        people=people,
        series=(),
        embeddings=(Embeddings(seed=0, source="null", people=names, w=w),),
        held_out=(
            HeldOut(
                seed=0,
                role="training",
                people=names,
                before=errors[0],
                after=errors[1],
                labels=np.ones(PEOPLE, dtype=np.int64),
                worsened=0,
                ratios=0.0,
                with_error=1,
            ),
        ),
        conditions=outcomes,
    )
    return data, constructs


if __name__ == "__main__":
    raise SystemExit(print_rows([*run(), *quality()]))
