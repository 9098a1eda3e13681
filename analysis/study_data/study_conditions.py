"""Outcomes of the conditions that a study's participants taught under, round by round."""

from collections.abc import Sequence

from steerlab.analysis.study_data.conditions_file import METRICS
from steerlab.analysis.study_data.records import ConditionValue, Person
from steerlab.study.opened import OpenStudy
from steerlab.study.store.teaching import read_teaching_rounds


def taught_rounds(study: OpenStudy, people: Sequence[Person]) -> list[ConditionValue]:
    """Success, distance and label error of the rounds that count, of the people who count."""
    counted = {person.id for person in people}
    return [
        ConditionValue(
            person=row["participant"],
            condition=row["condition"],
            metric=metric,
            value=float(row[metric]),
            round=row["round"],
            position=row["position"] - 1 if row["position"] else None,
        )
        for row in read_teaching_rounds(study.store.connection).to_pylist()
        if row["participant"] in counted
        for metric in METRICS
        if row[metric] is not None
    ]
