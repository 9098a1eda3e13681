"""Cells of ``tables.json`` in words: numbers as they are printed, and why a cell is empty."""

from collections.abc import Mapping
from typing import Any

from markupsafe import Markup

from steerlab.analysis.figures.study import METRIC_WORDS
from steerlab.analysis.study_tables.plain import EMPTY, is_empty
from steerlab.analysis.wording import decimal, learner_name, p_value, percent
from steerlab.study.surveys.questionnaire import Questionnaire

_MINUS = "\u2212"
VERDICTS = {
    "supported": "Supported",
    "not supported": "Not supported",
    "not testable": "Could not be tested",
}


class Reader:
    """What the templates call to show a cell.

    Args:
        questionnaires: by key, for the titles of outcomes that are their scales.
    """

    def __init__(self, questionnaires: Mapping[str, Questionnaire] | None = None) -> None:
        self._questionnaires = questionnaires or {}

    def number(self, cell: Any, form: str = "decimal") -> Markup | str:
        """A cell's number, or why there is none.

        Args:
            form: ``decimal`` (two digits), ``p``, ``percent``, ``count`` or ``digits3``.
        """
        if cell is None:
            return Markup('<span class="note">–</span>')
        if is_empty(cell):
            return self.why(cell)
        forms = {
            "decimal": lambda: decimal(cell),
            "p": lambda: p_value(cell),
            "percent": lambda: percent(cell),
            "count": lambda: str(cell),
            "digits3": lambda: f"{cell:.3g}".replace("-", _MINUS),
        }
        return forms[form]()

    def p(self, cell: Any) -> Markup | str:
        """``p = .012``, ``p < .001``, or why there is none."""
        if cell is None or is_empty(cell):
            return self.number(cell)
        shown = p_value(cell)
        return f"p\u00a0{shown}" if shown.startswith("<") else f"p\u00a0=\u00a0{shown}"

    def metric(self, key: str) -> str:
        """An outcome in words; a questionnaire's is spelt ``questionnaire.scale``."""
        asked, _, scale = key.partition(".")
        if scale and asked in self._questionnaires:
            questionnaire = self._questionnaires[asked]
            return f"{questionnaire.title}: {questionnaire.scale(scale).title}"
        words = METRIC_WORDS.get(key, key)
        return words[:1].upper() + words[1:]

    def condition(self, key: str) -> str:
        """A condition in words."""
        return learner_name(key)

    def untested(self, outcome: Mapping[str, Any]) -> Markup | str:
        """The one reason why an outcome was not tested at all; empty if any test was made."""
        tests = [outcome[name] for name in ("friedman", "repeated_measures", "mixed_model")]
        pairs = outcome["pairs"]
        tests += [pairs] if is_empty(pairs) else [pair["test"] for pair in pairs]
        reasons = {test[EMPTY] if is_empty(test) else "" for test in tests}
        return self.why(tests[0]) if len(reasons) == 1 and "" not in reasons else ""

    def why(self, cell: Mapping[str, str]) -> Markup:
        """The reason of an empty cell."""
        return Markup('<span class="empty">{}</span>').format(cell[EMPTY])

    def interval(self, cell: Any, form: str = "decimal") -> Markup | str:
        """``0.12 to 0.34``; empty if the estimate says already why there is none."""
        if cell is None or is_empty(cell):
            return ""
        low, high = (self.number(limit, form) for limit in cell)
        return f"{low}\u00a0to\u00a0{high}"

    def empty(self, cell: Any) -> bool:
        """Whether a cell has no value."""
        return is_empty(cell)

    def verdict(self, row: Mapping[str, Any]) -> str:
        """A hypothesis' verdict."""
        return VERDICTS[row["verdict"]]


def headline(tables: Mapping[str, Any]) -> str:
    """The verdicts in one sentence."""
    by: dict[str, list[str]] = {}
    for row in tables["hypotheses"]:
        by.setdefault(row["verdict"], []).append(row["id"])
    return "; ".join(
        f"{', '.join(by[verdict])} {words.lower()}"
        for verdict, words in VERDICTS.items()
        if verdict in by
    )
