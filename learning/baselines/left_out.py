"""The baselines by name, and which of them cannot be judged on given labels, with the reason.

Every report and every ``summary.json`` uses these names.
"""

from collections.abc import Sequence
from math import pi

import numpy as np

from steerlab.learning.empirical_bayes.grid import RATE_HZ, GridSeries
from steerlab.learning.presets import PAPER, PAPER_TEXT, MapperConfig
from steerlab.learning.series import CONTEXT, LabelSeries, by_person
from steerlab.learning.splits import StudySplit, drive_names
from steerlab.sim.vehicle import WHEEL_LIMIT

BASELINES = (
    "identity",
    "no_labels",
    "shared_gain",
    "person_gain",
    "person_gain_lag",
    "shared_ridge",
    "person_ridge",
    "no_embedding",
    "mean_embedding",
    "shuffled_embedding",
    "mind_meld",
    "mind_meld_paper",
    "mind_meld_paper_text",
    "eb_nonlinear",
    "sim_pretrained",
    "sim_pretrained_context",
    "auto",
)
"""Every baseline. A baseline that cannot be judged is named with the reason, see ``left_out``."""

CEILING = "true_style"
"""Told the teachers' true styles: a reference, not a method."""

FULL_ONLY = ("no_embedding", "mind_meld_paper", "mind_meld_paper_text", "auto", CEILING)
"""These train a network each, and ``auto`` every candidate anew; the quick choice does without."""


LEAST_RATE_HZ = 1.0
"""Below it the window of ±1 s of the baselines on a 20 Hz grid holds no second label. Down to it they
have been measured (docs/fit.md)."""

_ON_GRID = ("eb_nonlinear", "sim_pretrained", "sim_pretrained_context")
LEAST_DRIVES = 3
"""To choose a blend by: some are held out, and a ridge chooses its penalty by another."""

_MOST_RADPS = 2.0 * pi
_SLACK = 1e-6  # as for labels: rounding


def left_out(
    studies: Sequence[StudySplit],
    config: MapperConfig,
    *,
    full: bool,
    styles_known: bool = False,
) -> dict[str, str]:
    """Baselines to leave out, each with the reason as a clause; the same for all ``studies``.

    Args:
        studies: what will be fitted and judged, such as the folds of one table.
        config: MIND MELD's.
        full: whether baselines that train another network are wanted.
        styles_known: whether there are true styles, and so a ceiling to speak of.
    """
    reasons: dict[str, str] = {}
    if not full:
        quick = "it trains a network of its own, which the quick ladder does without"
        reasons |= {
            baseline: quick for baseline in FULL_ONLY if baseline != CEILING or styles_known
        }
    for baseline, settings in (("mind_meld_paper", PAPER), ("mind_meld_paper_text", PAPER_TEXT)):
        if config == settings:
            reasons[baseline] = "mind_meld itself has these settings here"
    series = _each_once(studies)
    if why := _without_motion(series):
        reasons |= dict.fromkeys(("sim_pretrained_context", "no_labels"), why)
    if any(len({drive.person for drive in study.train_seen}) < 2 for study in studies):
        reasons["eb_nonlinear"] = "a prior over people takes two to train on, and there is 1"
    for baseline, by_whom in (
        ("shared_ridge", ""),
        ("no_labels", ""),
        ("person_ridge", " by one person"),
    ):
        if any(_rollouts(study, each=bool(by_whom)) < 2 for study in studies):
            reasons[baseline] = (
                f"its penalty is chosen by leaving a rollout out, and there is only one{by_whom} "
                f"to train on"
            )
    fewest = min(_drives(study) for study in studies)
    if full and fewest < LEAST_DRIVES:
        reasons["auto"] = (
            f"it chooses by drives that are held out of those to train on, which takes "
            f"{LEAST_DRIVES}, and there are {fewest}"
        )
    if why := _off_grid(studies, series):
        reasons |= dict.fromkeys(_ON_GRID, why)
    return reasons


def _each_once(studies: Sequence[StudySplit]) -> list[LabelSeries]:
    parts = ("train_seen", "held_out_seen", "calibrate_new", "held_out_new")
    everything = (drive for study in studies for part in parts for drive in getattr(study, part))
    return list({id(drive): drive for drive in everything}.values())


def _rollouts(study: StudySplit, *, each: bool) -> int:
    """Number of rollouts to train on: of everyone together, or the most that one person has."""
    usable = [drive for drive in study.train_seen if drive.valid.any()]
    groups = by_person(usable).values() if each else [usable]
    return max((len({drive.rollout for drive in drives}) for drives in groups), default=0)


def _drives(study: StudySplit) -> int:
    usable = [drive for drive in study.train_seen if drive.valid.any()]
    return len(set(drive_names(usable).values()))


def _without_motion(series: Sequence[LabelSeries]) -> str | None:
    names = {drive.context_names for drive in series}
    if missing := [name for name in CONTEXT if any(name not in has for has in names)]:
        return f"it reads the car’s own motion, and the labels come without {', '.join(missing)}"
    wheel = _largest(series, "robot_wheel")
    if wheel > WHEEL_LIMIT * (1.0 + _SLACK):
        return (
            f"robot_wheel reaches {wheel / WHEEL_LIMIT:.3g} times the labels’ limit, so it is not "
            f"in their units"
        )
    yaw_rate = _largest(series, "yaw_rate_radps")
    if yaw_rate > _MOST_RADPS:
        return (
            f"yaw_rate_radps reaches {yaw_rate:.3g}, a turn a second and more: no car’s, in rad/s"
        )
    return None


def _largest(series: Sequence[LabelSeries], name: str) -> float:
    return max(
        float(np.abs(drive.context[:, drive.context_names.index(name)]).max()) for drive in series
    )


def _off_grid(studies: Sequence[StudySplit], series: Sequence[LabelSeries]) -> str | None:
    """Why labels cannot be read at ``RATE_HZ``."""
    slowest = min(drive.rate_hz for drive in series)
    if slowest < LEAST_RATE_HZ:
        return (
            f"labels come at {slowest:g} Hz, and below {LEAST_RATE_HZ:g} Hz its window of ±1 s "
            f"holds no second one"
        )
    whole = {
        id(drive) for drive in series if drive.valid.all()
    }  # a person who has one needs no check
    for study in studies:
        for learned in (study.train_seen, study.calibrate_new):
            for person, drives in by_person(learned).items():
                if not any(id(drive) in whole or _on_grid(drive) for drive in drives):
                    return (
                        f"it reads labels at {RATE_HZ:g} Hz, and {person!r} has no valid label at "
                        f"such a moment"
                    )
    return None


def _on_grid(series: LabelSeries) -> bool:
    return bool(GridSeries.from_series(series).valid.any())
