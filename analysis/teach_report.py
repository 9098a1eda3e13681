"""A downstream comparison (``steerlab teach``) in numbers and as a page."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np

from steerlab.analysis.figures.teach import (
    contact_figure,
    cost_figure,
    curve_figure,
    error_figure,
    path_figure,
)
from steerlab.analysis.page import render_page
from steerlab.analysis.statistics.bootstrap import mean_interval
from steerlab.analysis.statistics.corrections import holm
from steerlab.analysis.statistics.outcome import NotComputable, too_few
from steerlab.analysis.statistics.paired import wilcoxon
from steerlab.analysis.summary import InvalidSummary
from steerlab.analysis.wording import learner_name, p_value, percent, teachers
from steerlab.sim.arrays import FloatArray
from steerlab.sim.world import WorldSpec

SCHEMA = 1
METRICS = ("final_distance_m", "success")  # tested; lower and higher is better
LOWER_IS_BETTER = ("final_distance_m", "mean_distance_m", "collisions", "label_mae")
_RESAMPLES = 4000
_DIGITS = 6
_JUDGED = ("success", "collisions", "final_distance_m")
_SUMMED = ("labels_asked", "teacher_seconds", "switches")

METRIC_NAMES = {"final_distance_m": "distance\u00a0(m)", "success": "success"}
_SHOWN = ("dagger", "mind-meld", "oracle", "bc")  # first on the contact sheet, which is long

Shard = Mapping[str, Any]
"""One teacher's results as ``steerlab teach`` keeps them."""


def summarise(
    shards: Sequence[Shard],
    *,
    run: Mapping[str, Any],
    versions: Mapping[str, str],
    seconds: Mapping[str, float],
) -> dict[str, Any]:
    """``summary.json``: means over teachers, each first averaged over their learner seeds.

    Args:
        shards: of all teachers; those left out count in ``left_out`` only.
        run: the settings; its ``learners`` are the conditions.

    Raises:
        InvalidSummary: no teacher could be judged, or a learner is missing.
    """
    left_out = {shard["teacher"]: shard["left_out"] for shard in shards if shard["left_out"]}
    judged = [shard for shard in shards if not shard["left_out"]]
    if not judged:
        reasons = "; ".join(dict.fromkeys(left_out.values()))
        raise InvalidSummary(f"No teacher could be judged: {reasons or 'there is none'}")
    names = list(run["learners"])
    for shard in judged:
        if lacking := [name for name in names if name not in shard["conditions"]]:
            raise InvalidSummary(
                f"{shard['teacher']} has not taught {', '.join(lacking)}; give the command again."
            )
    people = {name: [_person(shard, name) for shard in judged] for name in names}
    tables = {
        name: {key: _column(people[name], key) for key in people[name][0] if key != "by_round"}
        for name in names
    }
    return {
        "schema": SCHEMA,
        "verb": "teach",
        "task": run["task"],
        "rounds": run["rounds"],
        "teachers": len(judged),
        "seed": run["seed"],
        "run": dict(run),
        "versions": dict(sorted(versions.items())),
        "seconds": {name: round(value, 1) for name, value in seconds.items()},
        "left_out": left_out,
        "conditions": {
            name: {key: _mean(values) for key, values in tables[name].items()}
            | {"by_round": _by_round(people[name])}
            for name in names
        },
        "tests": compare(tables, seed=run["seed"]),
    }


def compare(tables: Mapping[str, Mapping[str, FloatArray]], *, seed: int) -> list[dict[str, Any]]:
    """Paired tests over teachers for ``pairs_of`` the conditions; Holm over all of them.

    ``better`` and ``worse`` count teachers for whom a is better or worse than b, ``effect`` is the
    matched-pairs rank-biserial correlation (positive: a is better), ``ci95`` the bootstrap interval
    of the mean of a - b over teachers. Wilcoxon's test needs four teachers; with fewer nothing is
    tested.
    """
    tests: list[dict[str, Any]] = []
    for metric in METRICS:
        for first, second in pairs_of(list(tables)):
            first_values, second_values = tables[first][metric], tables[second][metric]
            if too_few(len(first_values)):
                continue
            result = wilcoxon(first_values, second_values)
            better = -1.0 if metric in LOWER_IS_BETTER else 1.0
            gain = better * (first_values - second_values)
            same = isinstance(result, NotComputable)  # for every teacher
            tests.append(
                {
                    "a": first,
                    "b": second,
                    "metric": metric,
                    "better": int((gain > 0).sum()),
                    "worse": int((gain < 0).sum()),
                    "p": 1.0 if same else result.p,
                    "p_holm": 1.0,
                    "effect": 0.0 if same else round(better * result.rank_biserial, _DIGITS),
                    "ci95": _interval(
                        first_values - second_values, np.random.default_rng([seed, 0xB007])
                    ),
                }
            )
    adjusted = holm(np.array([test["p"] for test in tests])) if tests else []
    for test, p_holm in zip(tests, adjusted, strict=True):
        test["p_holm"] = round(float(p_holm), _DIGITS)
        test["p"] = round(test["p"], _DIGITS)
    return tests


def pairs_of(names: Sequence[str]) -> list[tuple[str, str]]:
    """MIND MELD against everything else, DAgger against BC, and each learner against DAgger."""
    pairs = [("mind-meld", other) for other in names if other != "mind-meld"]
    pairs += [(other, "dagger") for other in names if other not in ("dagger", "mind-meld")]
    return [(first, second) for first, second in pairs if first in names and second in names]


def shown_shard(shards: Sequence[Shard]) -> Shard:
    """The teacher whose drives a page shows: the first that was judged."""
    return next(shard for shard in shards if not shard["left_out"])


def person_points(
    shards: Sequence[Shard], names: Sequence[str]
) -> dict[str, list[tuple[float, float]]]:
    """Each judged teacher's label error and final success by learner; NaN where nobody was asked."""
    points: dict[str, list[tuple[float, float]]] = {}
    for name in names:
        people = [_person(shard, name) for shard in shards if not shard["left_out"]]
        errors = _column(people, "label_mae")
        points[name] = [
            (float(error), person["success"]) for error, person in zip(errors, people, strict=True)
        ]
    return points


def table_lines(summary: Mapping[str, Any]) -> list[str]:
    """A small table for the terminal."""
    lines = [
        f"{'learner':<24}{'success':>9}{'distance m':>12}{'label MAE':>11}{'labels':>8}{'hits':>7}"
    ]
    for name, condition in summary["conditions"].items():
        mae = condition["label_mae"]
        lines.append(
            f"{name:<24}{condition['success']:>9.2f}{condition['final_distance_m']:>12.1f}"
            f"{'-' if mae is None else format(mae, '.2f'):>11}{condition['labels_asked']:>8.0f}"
            f"{condition['collisions']:>7.2f}"
        )
    for name, why in summary["left_out"].items():
        lines.append(f"left out: {name}: {why}")
    return lines


def _person(shard: Shard, name: str) -> dict[str, Any]:
    """One teacher's figures, averaged over learner seeds."""
    seeds = [seed["by_round"] for seed in shard["conditions"][name]]
    rounds = len(seeds[0])
    by_round = [
        {"round": seeds[0][row]["round"]}
        | {
            key: _average([rounds_[row][key] for rounds_ in seeds])
            for key in (*_JUDGED, *_SUMMED, "label_mae")
        }
        for row in range(rounds)
    ]
    last = by_round[-1]
    errors = [row["label_mae"] for row in by_round[1:]]
    judged = [row["final_distance_m"] for row in by_round if row["final_distance_m"] is not None]
    return {
        "success": last["success"],
        "final_distance_m": last["final_distance_m"],
        "mean_distance_m": float(np.mean(judged)),
        "collisions": last["collisions"],
        "label_mae": _average(errors),
        **{key: float(_column(by_round, key).sum()) for key in _SUMMED},
        "by_round": by_round,
    }


def _by_round(people: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Means over teachers, with bootstrap intervals where policies were judged."""
    rows: list[dict[str, Any]] = []
    for index, first in enumerate(people[0]["by_round"]):
        rounds = [person["by_round"][index] for person in people]
        row: dict[str, Any] = {"round": first["round"]}
        for key in (*_JUDGED, *_SUMMED, "label_mae"):
            row[key] = _mean(_column(rounds, key))
        for key in ("success", "final_distance_m"):
            values = _column(rounds, key)
            known = values[np.isfinite(values)]
            rng = np.random.default_rng(index)
            row[f"{key}_ci95"] = _interval(known, rng) if len(known) > 1 else None
        rows.append(row)
    return rows


def _column(rows: Sequence[Mapping[str, Any]], key: str) -> FloatArray:
    """Values with NaN for null, (rows,)."""
    return np.array([np.nan if row[key] is None else row[key] for row in rows], dtype=np.float64)


def _average(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else None


def _mean(values: FloatArray) -> float | None:
    known = values[np.isfinite(values)]
    return round(float(known.mean()), _DIGITS) if len(known) else None


def _interval(values: FloatArray, rng: np.random.Generator) -> list[float]:
    interval = mean_interval(values, rng, resamples=_RESAMPLES)
    return [round(interval.low, _DIGITS), round(interval.high, _DIGITS)]


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


def headline(summary: Mapping[str, Any]) -> str:
    """The result in one sentence: MIND MELD beside DAgger if both were there, else the best."""
    conditions = summary["conditions"]
    if {"mind-meld", "dagger"} <= set(conditions):
        ours, theirs = (conditions[name]["success"] for name in ("mind-meld", "dagger"))
        return (
            f"Policies taught by {teachers(summary['teachers'])} reached the ball in "
            f"{percent(ours)} of drives with MIND MELD’s labels, in {percent(theirs)} with the "
            "teachers’ own"
        )
    best = max(conditions, key=lambda name: conditions[name]["success"])
    if len(conditions) == 1:
        return (
            f"Policies taught by {teachers(summary['teachers'])} as {learner_name(best)} reached "
            f"the ball in {percent(conditions[best]['success'])} of drives"
        )
    return (
        f"Of {len(conditions)} learners {learner_name(best)} reached the ball most: "
        f"{percent(conditions[best]['success'])} of drives"
    )


def verdict(summary: Mapping[str, Any]) -> str:
    """Whether the difference between MIND MELD and DAgger is established; empty without a test."""
    for test in summary["tests"]:
        if (test["a"], test["b"], test["metric"]) == ("mind-meld", "dagger", "success"):
            break
    else:
        return ""
    sure = test["p_holm"] < 0.05
    p = p_value(test["p_holm"])
    counts = f"better for {test['better']}, worse for {test['worse']}"
    return (
        f"MIND MELD against DAgger over teachers: {counts}; p {p if p.startswith('<') else f'= {p}'} "
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
    figures = {
        "curves": curve_figure(summary["conditions"]),
        "error": error_figure(summary["conditions"], points),
        "cost": cost_figure(summary["conditions"]),
        "paths": path_figure(report.world, {name: first[name]["by_round"] for name in names}),
        "contact": contact_figure({name: first[name]["frames"] for name in pictured}),
    }
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
        p_value=p_value,
    )
