"""The report of ``steerlab teach``: what better labels did for driving."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

from matplotlib.figure import Figure

from steerlab.analysis.figures.learners import learner_name
from steerlab.analysis.figures.teach import cost_figure, curve_figure, error_figure
from steerlab.analysis.figures.teach_drives import contact_figure, path_figure
from steerlab.analysis.page import render_page
from steerlab.analysis.teach_summary import Shard, person_points, shown_shard
from steerlab.analysis.wording import percent, teachers
from steerlab.sim.world import WorldSpec

METRIC_NAMES = {"final_distance_m": "distance\u00a0(m)", "success": "success"}
_SHOWN = ("dagger", "mind-meld", "oracle", "bc")  # first on the contact sheet, which is long


@dataclass(frozen=True, kw_only=True)
class TeachReport:
    """All that the page shows.

    Attributes:
        summary: as ``summarise`` makes it.
        shards: every teacher's; paths and pictures are of the first that was not left out.
        recordings: files beside the page's folder, as the reader would name them.
    """

    summary: Mapping[str, Any]
    shards: Sequence[Shard]
    world: WorldSpec
    command: str
    recordings: Sequence[str] = ()


@dataclass(frozen=True, kw_only=True)
class TeachFigures:
    """The page's figures."""

    curves: Figure
    error: Figure
    cost: Figure
    paths: Figure
    contact: Figure


def headline(summary: Mapping[str, Any]) -> str:
    """The finding in one sentence: MIND MELD beside DAgger if both were there, else the best."""
    found = summary["conditions"]
    if {"mind-meld", "dagger"} <= set(found):
        ours, theirs = (found[name]["success"] for name in ("mind-meld", "dagger"))
        return (
            f"Policies taught by {teachers(summary['teachers'])} reached the ball in "
            f"{percent(ours)} of drives with MIND MELD’s labels, in {percent(theirs)} with the "
            "teachers’ own"
        )
    best = max(found, key=lambda name: found[name]["success"])
    if len(found) == 1:
        return (
            f"Policies taught by {teachers(summary['teachers'])} as {learner_name(best)} reached "
            f"the ball in {percent(found[best]['success'])} of drives"
        )
    return (
        f"Of {len(found)} learners {learner_name(best)} reached the ball most: "
        f"{percent(found[best]['success'])} of drives"
    )


def verdict(summary: Mapping[str, Any]) -> str:
    """Whether the difference between MIND MELD and DAgger is established; empty without a test."""
    for test in summary["tests"]:
        if (test["a"], test["b"], test["metric"]) == ("mind-meld", "dagger", "success"):
            break
    else:
        return ""
    sure = test["p_holm"] < 0.05
    counts = f"better for {test['better']}, worse for {test['worse']}"
    return (
        f"MIND MELD against DAgger over teachers: {counts}; p {p_text(test['p_holm'], sign=True)} "
        f"after Holm’s correction{'' if sure else ', which does not establish a difference'}."
    )


def render_teach_report(report: TeachReport) -> str:
    """The page; equal reports give equal text."""
    summary = report.summary
    names = list(summary["conditions"])
    shown = shown_shard(report.shards)
    first = {name: shown["conditions"][name][0] for name in names}
    pictured = [name for name in _SHOWN if name in names] or names[:4]
    points = person_points(report.shards, names)
    figures = TeachFigures(
        curves=curve_figure(summary["conditions"]),
        error=error_figure(summary["conditions"], points),
        cost=cost_figure(summary["conditions"]),
        paths=path_figure(report.world, {name: one["by_round"] for name, one in first.items()}),
        contact=contact_figure({name: first[name]["frames"] for name in pictured}),
    )
    return render_page(
        "teach.html.j2",
        values=summary,
        figures=figures,
        report=report,
        summary=SimpleNamespace(**summary),
        shown=shown["teacher"],
        headline=headline(summary),
        verdict=verdict(summary),
        learner_name=learner_name,
        metric_name=METRIC_NAMES.__getitem__,
        p_text=p_text,
    )


def p_text(value: float, *, sign: bool = False) -> str:
    """A p value with as many digits as it deserves, in one line; with ``sign``, ``= `` before it."""
    if value < 0.001:
        return "<\u00a0.001"
    text = f"{value:.3f}".lstrip("0") if value < 0.9995 else "1"
    return f"= {text}" if sign else text
