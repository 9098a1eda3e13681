"""Everyone's style metrics, by exact DTW, and by fastdtw as the paper's method if asked for."""

from collections.abc import Sequence
from typing import Any

from steerlab.analysis.study_data.records import StudyData
from steerlab.analysis.study_tables.plain import plain
from steerlab.analysis.style.person_style import PersonStyle, people_styles
from steerlab.learning.series import LabelSeries

METRICS = (
    "amplitude",
    "amplitude_total",
    "wrong_direction",
    "lag_s",
    "lag_plain_s",
    "vote",
    "voted_lag_s",
)
FAST = ("amplitude_total", "lag_plain_s", "vote", "voted_lag_s")
"""What is also given by fastdtw; the scaled lag always comes from the exact path."""


def exact_styles(data: StudyData, *, unflagged: bool = False) -> list[PersonStyle]:
    """Styles by exact DTW; ``unflagged`` leaves out attempts that broke a limit of timing."""
    series: Sequence[LabelSeries] = data.series
    if unflagged:
        series = [one for one in series if (one.person, one.rollout) not in data.flagged]
    return people_styles(series, latency_s=_latencies(data))


def style_table(data: StudyData, styles: Sequence[PersonStyle], *, fastdtw: bool) -> dict[str, Any]:
    """A row a person; ``fastdtw`` adds columns by that method, radius 10, which takes minutes."""
    roles = {person.id: person.role for person in data.people}
    latency_s = _latencies(data)
    fast: dict[str, PersonStyle] = {}
    if fastdtw:
        found = people_styles(data.series, method="fastdtw", latency_s=latency_s)
        fast = {one.person: one for one in found}
    rows: list[dict[str, Any]] = []
    for one in styles:
        row: dict[str, Any] = {
            "person": one.person,
            "role": roles[one.person],
            "rollouts": len(one.rollouts),
            "latency_subtracted": one.person in latency_s,
            **{name: plain(getattr(one, name)) for name in METRICS},
        }
        if one.person in fast:
            row |= {f"{name}_fastdtw": plain(getattr(fast[one.person], name)) for name in FAST}
        rows.append(row)
    return {
        "method": "exact DTW" + (", and fastdtw with radius 10" if fastdtw else ""),
        "fastdtw": "computed" if fastdtw else "not computed; add --fastdtw",
        "rows": rows,
    }


def _latencies(data: StudyData) -> dict[str, float]:
    return {one.id: one.latency_s for one in data.people if one.latency_s is not None}
