"""Power curves from counts of rejections, the sample size that reaches a power, and their report."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import ceil, sqrt
from types import SimpleNamespace
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from steerlab.analysis.figures.look import (
    BLUE,
    FAINT,
    INK,
    MUTED,
    SEEN_MARKER,
    SMALL_PT,
    TEXT_PT,
    VERMILLION,
    new_figure,
    quiet,
)
from steerlab.analysis.page import render_page
from steerlab.analysis.power_study.design import PowerDesign
from steerlab.analysis.power_study.simulated_studies import HOLM
from steerlab.analysis.statistics.outcome import NotComputable
from steerlab.analysis.statistics.signed_rank_power import signed_rank_power
from steerlab.analysis.study_tables.plain import plain
from steerlab.analysis.study_tables.reading import Reader
from steerlab.sim.arrays import FloatArray
from steerlab.sim.errors import InvalidConfig

TARGETS = (0.8, 0.9)  # the powers that one plans for
_Z = 1.96
_COLOURS = (BLUE, VERMILLION, "#009E73", "#CC79A7", "#E69F00", "#56B4E9", INK)
_LINES = ("-", ":")  # dashed is after Holm


@dataclass(frozen=True, kw_only=True, eq=False)
class PowerCurve:
    """One test's power by sample size.

    Attributes:
        people: (sizes,), rising.
        power: (sizes,) shares of studies that reject.
        error: (sizes,) their Monte-Carlo standard errors.
        studies: of each size.
    """

    test: str
    people: tuple[int, ...]
    power: FloatArray
    error: FloatArray
    studies: tuple[int, ...]

    @classmethod
    def of(
        cls, test: str, people: Sequence[int], rejected: Sequence[int], studies: Sequence[int]
    ) -> "PowerCurve":
        """From the number of rejections and of studies, for each sample size."""
        power = np.array(rejected, dtype=np.float64) / np.array(studies)
        # Of a share of 0 or 1 the plain error would be 0: add two of each (Agresti & Coull 1998).
        smooth = (np.array(rejected) + 2.0) / (np.array(studies) + 4.0)
        error = np.sqrt(smooth * (1.0 - smooth) / (np.array(studies) + 4.0))
        return cls(
            test=test,
            people=tuple(people),
            power=power,
            error=error,
            studies=tuple(studies),
        )

    def people_for(self, target: float) -> "PeopleNeeded | NotComputable":
        """The sample size with that power: interpolated between sizes, never beyond them."""
        rising = _never_falling(self.power)
        reached = _reach(self.people, rising, target)
        if reached is None:
            return NotComputable(
                reason=f"power is {rising[-1]:.2f} with {self.people[-1]} people, the most tried"
            )
        low = _reach(self.people, _never_falling(self.power + _Z * self.error), target)
        high = _reach(self.people, _never_falling(self.power - _Z * self.error), target)
        return PeopleNeeded(
            people=_whole(reached),
            low=_whole(reached if low is None else low),
            high=None if high is None else _whole(high),
            at_most=bool(rising[0] >= target),
        )

    def values(self) -> dict[str, Any]:
        """The curve as plain values, for JSON."""
        return {
            "test": self.test,
            "people": list(self.people),
            "power": plain(self.power),
            "monte_carlo_error": plain(self.error),
            "studies": list(self.studies),
            **{f"people_for_{round(100 * t)}": plain(self.people_for(t)) for t in TARGETS},
        }


@dataclass(frozen=True, kw_only=True, slots=True)
class PeopleNeeded:
    """The sample size that reaches a power.

    Attributes:
        low, high: from 1.96 Monte-Carlo errors above and below the curve; ``high`` is None where
            the lower one does not get there.
        at_most: already the smallest size tried has that power.
    """

    people: int
    low: int
    high: int | None
    at_most: bool


def _whole(people: float) -> int:
    return ceil(people - 1e-6)  # a size that was tried stays itself, however its root rounds


def _never_falling(power: FloatArray) -> FloatArray:
    """The closest curve that never falls (pool adjacent violators)."""
    blocks: list[list[float]] = []  # mean, size
    for value in power.tolist():
        blocks.append([value, 1.0])
        while len(blocks) > 1 and blocks[-2][0] > blocks[-1][0]:
            last, size = blocks.pop()
            mean, before = blocks[-1]
            blocks[-1] = [(mean * before + last * size) / (before + size), before + size]
    return np.concatenate([np.full(int(size), mean) for mean, size in blocks])


def _reach(people: Sequence[int], power: FloatArray, target: float) -> float | None:
    """Where the curve, straight over the root of n between sizes, first reaches ``target``."""
    at = int(np.argmax(power >= target))
    if power[at] < target:
        return None
    if at == 0:
        return float(people[0])
    low, high = sqrt(people[at - 1]), sqrt(people[at])
    share = (target - power[at - 1]) / (power[at] - power[at - 1])
    return float(low + share * (high - low)) ** 2


def power_figure(curves: Sequence[PowerCurve]) -> Figure:
    """A line a test; bars are 1.96 Monte-Carlo errors, thin lines mark ``TARGETS``.

    Raises:
        InvalidConfig: no curve.
    """
    if not curves:
        raise InvalidConfig("No test was simulated; there is no curve to draw.")
    figure = new_figure(8.6, 4.0 + 0.18 * len(curves))
    axes = figure.add_subplot()
    quiet(axes, grid="y")
    for target in TARGETS:
        axes.axhline(target, color=FAINT, linewidth=1.4)
        axes.annotate(
            f"{100 * target:.0f} %",
            (1.0, target),
            xycoords=("axes fraction", "data"),
            xytext=(3, 0),
            textcoords="offset points",
            va="center",
            size=SMALL_PT,
            color=MUTED,
        )
    plain = list(dict.fromkeys(curve.test.removesuffix(HOLM) for curve in curves))
    for curve in curves:
        row = plain.index(curve.test.removesuffix(HOLM))
        axes.errorbar(
            curve.people,
            curve.power,
            yerr=1.96 * curve.error,
            color=_COLOURS[row % len(_COLOURS)],
            linestyle="--" if curve.test.endswith(HOLM) else _LINES[row // len(_COLOURS) % 2],
            marker=SEEN_MARKER,
            markersize=3.5,
            linewidth=1.5,
            elinewidth=0.9,
            label=curve.test,
        )
    axes.set_xscale("function", functions=(_root, _square))
    axes.set_xticks(curves[0].people, [str(size) for size in curves[0].people])
    axes.set_ylim(-0.02, 1.04)
    axes.set_xlabel("people (root scale)", size=TEXT_PT)
    axes.set_ylabel("share of studies that reject")
    figure.legend(loc="outside lower center", ncols=2, fontsize=SMALL_PT, frameon=False)
    return figure


def _root(values: FloatArray) -> FloatArray:
    return np.sqrt(np.abs(values))


def _square(values: FloatArray) -> FloatArray:
    return values**2


@dataclass(frozen=True, kw_only=True)
class PowerReport:
    """All that the page shows; ``taught`` says where people's outcomes were drawn from, if so."""

    design: PowerDesign
    curves: Sequence[PowerCurve]
    taught: str
    versions: Mapping[str, str]
    seconds: Mapping[str, float]
    command: str


def render_power(report: PowerReport) -> str:
    """The page; equal reports give equal text."""
    values: list[dict[str, Any]] = [curve.values() for curve in report.curves]
    return render_page(
        "power.html.j2",
        values={"curves": values},
        figures={"power": power_figure(report.curves)},
        report=report,
        design=report.design,
        curves=values,
        read=Reader(),
        h1_power=signed_rank_power(1.0, 12, alpha=report.design.alpha),
        summary=SimpleNamespace(
            seed=report.design.seed, versions=report.versions, seconds=report.seconds
        ),
    )


def needed_text(cell: Mapping[str, Any]) -> str:
    """A sample size with its Monte-Carlo range; ``cell`` has one."""
    if cell["at_most"]:
        return f"≤ {cell['people']}"
    if cell["high"] is None:
        return f"{cell['people']} (from {cell['low']})"
    return f"{cell['people']} ({cell['low']}–{cell['high']})"
