"""Variables and values of everything that a study asks: items, and the scores of scales."""

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from steerlab.analysis.export.tables import Column
from steerlab.analysis.export.variables import Level, Measure, Source, Variable, column_name
from steerlab.analysis.study_data.asked import Answered, Asking
from steerlab.analysis.study_data.whole_study import WholePerson, WholeStudy
from steerlab.study.surveys.answer_format import Choice, FreeText, Likert, Number, Slider
from steerlab.study.surveys.questionnaire import Item, Questionnaire, Scale
from steerlab.study.surveys.scoring import ScaleScore, score


@dataclass(frozen=True, kw_only=True)
class Place:
    """A questionnaire in a place where it is asked.

    Attributes:
        prefix: begins the names of its columns: nothing for a questionnaire that is asked once, the
            condition for one that follows each condition, else the phase.
        name: of the questionnaire in those names: a translation has that of what it translates, so
            that studies in two languages have the same columns, unless this study asks several of them.
    """

    asking: Asking
    questionnaire: Questionnaire
    prefix: tuple[str, ...]
    name: str

    @property
    def about(self) -> str:
        """When it was asked, for labels; empty where it is asked once."""
        return f" ({', '.join(self.prefix)})" if self.prefix else ""

    def items(self, *, free_text: bool) -> list[Item]:
        """The items that are exported."""
        everything = self.questionnaire.items
        return [one for one in everything if free_text or not isinstance(one.format, FreeText)]

    def source(self, part: str, reversed_in: tuple[str, ...] = ()) -> Source:
        """Where a column comes from."""
        return Source(
            questionnaire=self.questionnaire.key,
            version=self.questionnaire.version,
            phase=self.asking.phase,
            condition=self.asking.condition or "",
            part=part,
            reversed_in=reversed_in,
            citation=self.questionnaire.citation.strip(),
        )


def places(study: WholeStudy) -> list[Place]:
    """Every questionnaire in every place, in the order in which they are asked."""
    alone = [one for one in study.asked if one.condition is None]
    several = len(study.teach_phases) > 1
    keys = {one.questionnaire for one in study.asked}
    languages = Counter(study.questionnaires[key].original for key in keys)
    found: list[Place] = []
    for one in study.asked:
        again = sum(other.questionnaire == one.questionnaire for other in alone) > 1
        if one.condition is not None:
            prefix = (one.phase, one.condition) if several else (one.condition,)
        else:
            prefix = (one.phase,) if again else ()
        asked = study.questionnaires[one.questionnaire]
        name = asked.original if languages[asked.original] == 1 else asked.key
        found.append(Place(asking=one, questionnaire=asked, prefix=prefix, name=name))
    return found


def asked_columns(study: WholeStudy, *, free_text: bool) -> Iterator[Column]:
    """Each item's answer and then each scale's score, a row for each participant."""
    for place in places(study):
        given = [person.answers[place.asking] for person in study.people]
        for item in place.items(free_text=free_text):
            yield Column(
                variable=item_variable(place, item),
                values=[one.given.get(item.id) for one in given],
                why=[one.why_missing(item.id) for one in given],
            )
        scored = [scores_of(place, one) for one in given]
        for scale in place.questionnaire.scales:
            yield Column(
                variable=score_variable(place, scale),
                values=[one[scale.key].score if one else None for one in scored],
            )


def scores_of(place: Place, answered: Answered) -> Mapping[str, ScaleScore]:
    """The scores by scale; empty where the page was not handed in."""
    return {} if answered.state is not None else score(place.questionnaire, answered.given)


def item_variable(place: Place, item: Item) -> Variable:
    """The variable of an item's answer."""
    asked, scales = item.format, place.questionnaire.scales
    levels: tuple[Level, ...] = ()
    low: float | None = None
    high: float | None = None
    measure: Measure = "nominal"
    kind, unit = "whole", ""
    match asked:
        case Likert():
            levels = tuple(Level(value=value, label=words) for value, words in asked.anchors)
            low, high, measure = asked.low, asked.high, "ordinal"
        case Slider():
            ends = ((asked.low, asked.low_label), (asked.high, asked.high_label))
            levels = tuple(Level(value=value, label=words) for value, words in ends)
            low, high, measure = asked.low, asked.high, "scale"
        case Number():
            kind, unit = ("whole" if asked.whole else "number"), asked.unit
            low, high, measure = asked.minimum, asked.maximum, "scale"
        case Choice():
            levels = tuple(Level(value=one.value, label=one.text) for one in asked.options)
            kind = "choice"
        case FreeText():
            kind = "text"
    return Variable(
        name=column_name(*place.prefix, place.name, item.id),
        label=item.text + _attention(item) + place.about,
        kind=kind,
        measure=measure,
        unit=unit,
        levels=tuple(sorted(levels, key=lambda level: level.value)) if low is not None else levels,
        low=low,
        high=high,
        source=place.source(
            item.id, tuple(scale.key for scale in scales if item.id in scale.reversed)
        ),
        asked=True,
    )


def _attention(item: Item) -> str:
    """What an attention check is to be answered with; of other items nothing."""
    return "" if item.attention is None else f" [attention check, right: {item.attention}]"


def score_variable(place: Place, scale: Scale) -> Variable:
    """The variable of a scale's score."""
    low, high = place.questionnaire.score_range(scale.key)
    turned = f"; reversed: {', '.join(scale.reversed)}" if scale.reversed else ""
    return Variable(
        name=column_name(*place.prefix, place.name, scale.key, "score"),
        label=f"{scale.title}, {scale.how} of {len(scale.items)} items{turned}{place.about}",
        kind="number",
        measure="scale",
        low=low,
        high=high,
        source=place.source(scale.key),
    )


def answers_in_order(study: WholeStudy) -> Iterator[tuple[WholePerson, Place, Answered]]:
    """Each person's answers in each place, person by person."""
    everywhere = places(study)
    for person in study.people:
        for place in everywhere:
            yield person, place, person.answers[place.asking]
