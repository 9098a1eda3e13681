"""Cells of ``tables.json`` in words: numbers as they are printed, and why a cell is empty."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from markupsafe import Markup

from steerlab.analysis.figures.study import METRIC_WORDS
from steerlab.analysis.study_tables.plain import EMPTY, is_empty
from steerlab.analysis.wording import count, counted, decimal, learner_name, p_value, percent
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
            form: ``decimal`` (two decimals), ``tenth`` (one), ``p``, ``percent`` or ``count``.
        """
        if cell is None:
            return Markup('<span class="note">–</span>')
        if is_empty(cell):
            return self.why(cell)
        forms = {
            "decimal": lambda: decimal(cell),
            "p": lambda: p_value(cell),
            "percent": lambda: percent(cell),
            "count": lambda: count(cell),
            "tenth": lambda: f"{cell:.1f}".replace("-", _MINUS),
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
            title, whole = questionnaire.scale(scale).title, questionnaire.title
            return title if title.split()[0] == whole.split()[0] else f"{whole}: {title}"
        words = METRIC_WORDS.get(key, key)
        return words[:1].upper() + words[1:]

    def condition(self, key: str) -> str:
        """A condition in words."""
        return learner_name(key)

    def untested(self, outcome: Mapping[str, Any]) -> str:
        """The one reason why an outcome was not tested at all; empty if any test was made."""
        tests = [outcome[name] for name in ("friedman", "repeated_measures", "mixed_model")]
        pairs = outcome["pairs"]
        tests += [pairs] if is_empty(pairs) else [pair["test"] for pair in pairs]
        reasons = {test[EMPTY] if is_empty(test) else "" for test in tests}
        return reasons.pop() if len(reasons) == 1 else ""

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

    def or_dash(self, cell: Any, form: str = "decimal") -> Markup | str:
        """A cell's number; a dash where ``reasons`` says under the table why there is none."""
        return self.number(None if is_empty(cell) else cell, form)

    def reasons(self, cells: Iterable[Any]) -> str:
        """Why some of ``cells`` are empty, each reason once."""
        return "; ".join(dict.fromkeys(cell[EMPTY] for cell in cells if is_empty(cell)))

    def same(self, rows: Sequence[Mapping[str, Any]], key: str) -> Any:
        """What all rows have under ``key``; None if they differ."""
        values = {row[key] for row in rows}
        return values.pop() if len(values) == 1 else None

    def cannot(self, test: Mapping[str, Any], alpha: float) -> str:
        """Why a test could not be significant; empty if it could."""
        smallest = test.get("smallest_p", 0.0)
        if smallest < alpha:
            return ""
        return f"could not be significant: the smallest p there can be is {p_value(smallest)}"

    def pairs_cannot(self, pairs: Sequence[Mapping[str, Any]], alpha: float) -> str:
        """Why no pair of conditions could be significant; empty if one could."""
        smallest = [p["smallest_p_holm"] for p in pairs if not is_empty(p["smallest_p_holm"])]
        if not smallest or min(smallest) < alpha:
            return ""
        return (
            f"no pair could be significant: with {counted(len(smallest), 'pair')} the smallest p "
            f"there can be after Holm’s correction is {p_value(min(smallest))}"
        )

    def score_form(self, row: Mapping[str, Any]) -> str:
        """Digits of a scale's scores: sums over wide ranges have one, means of answers two."""
        return "tenth" if row["high"] - row["low"] >= 10 else "decimal"

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
