"""Algorithm 1's comparison: success, distance, label error and questionnaires by condition."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from steerlab.analysis.statistics.bootstrap import mean_interval
from steerlab.analysis.statistics.mixed_model import mixed_model
from steerlab.analysis.statistics.omnibus import cochran_q, friedman, repeated_measures
from steerlab.analysis.statistics.outcome import NotComputable, too_few
from steerlab.analysis.statistics.paired import all_pairs, mcnemar, wilcoxon
from steerlab.analysis.study_data.records import ConditionValue, StudyData
from steerlab.analysis.study_tables.plain import empty, plain
from steerlab.analysis.study_tables.sizes import BANDS, mark
from steerlab.sim.arrays import FloatArray
from steerlab.sim.seeds import rng_for

NO_CONDITIONS = "no outcome of any condition is on record"
OVER_ROUNDS = ("label_mae",)
"""The person's mean over rounds but the demonstration, round 0; the others are the last round's."""


def conditions(data: StudyData, *, seed: int) -> dict[str, Any]:
    """By metric: means and curves, the tests over all conditions, and Holm-corrected pairs."""
    if not data.conditions:
        return {"metrics": {}, "why_empty": NO_CONDITIONS}
    metrics = dict.fromkeys(value.metric for value in data.conditions)
    return {
        "metrics": {
            metric: _metric(
                [value for value in data.conditions if value.metric == metric], metric, seed
            )
            for metric in metrics
        }
    }


def outcome_table(
    values: Sequence[ConditionValue], metric: str
) -> dict[tuple[str, str], tuple[float, int | None]]:
    """By person and condition, the value that is tested and the condition's place in the order."""
    last = max((value.round for value in values if value.round is not None), default=None)
    by_key: dict[tuple[str, str], list[ConditionValue]] = {}
    for value in values:
        if (value.round != 0) if metric in OVER_ROUNDS else (value.round == last):
            by_key.setdefault((value.person, value.condition), []).append(value)
    return {
        key: (float(np.mean([v.value for v in rounds])), rounds[0].position)
        for key, rounds in by_key.items()
    }


def _metric(values: Sequence[ConditionValue], metric: str, seed: int) -> dict[str, Any]:
    names = list(dict.fromkeys(value.condition for value in values))
    cells = outcome_table(values, metric)
    people = list(dict.fromkeys(value.person for value in values))
    complete = [who for who in people if all((who, name) in cells for name in names)]
    table = np.array([[cells[who, name][0] for name in names] for who in complete])
    rows = {
        "conditions": names,
        "people": len(complete),
        "left_out": [
            {
                "person": who,
                "why": "no value under " + ", ".join(n for n in names if (who, n) not in cells),
            }
            for who in people
            if who not in complete
        ],
        "tested": _when(values, metric),
        "means": {name: _mean_cell(cells, people, name) for name in names},
        "curves": _curves(values, names, seed),
    }
    if len(names) < 2 or not complete:
        why = (
            f"only one condition, {names[0]}: there is nothing to compare"
            if len(names) < 2
            else "nobody has a value under every condition"
        )
        return rows | dict.fromkeys(
            ("friedman", "repeated_measures", "mixed_model", "pairs", "binary"), empty(why)
        )
    rng = rng_for(seed, metric)
    return rows | {
        "friedman": plain(friedman(table, rng=rng)),
        "repeated_measures": plain(repeated_measures(table)),
        "mixed_model": _mixed(cells, people, names),
        "pairs": [plain(pair) for pair in all_pairs(table, names, wilcoxon)],
        "binary": _binary(table, names, metric, rng),
    }


def _when(values: Sequence[ConditionValue], metric: str) -> str:
    if all(value.round is None for value in values):
        return "asked after the condition"
    return (
        "mean over rounds after the demonstration"
        if metric in OVER_ROUNDS
        else "after the last round"
    )


def _mean_cell(
    cells: dict[tuple[str, str], tuple[float, int | None]], people: Sequence[str], name: str
) -> dict[str, Any]:
    known = np.array([cells[who, name][0] for who in people if (who, name) in cells])
    missing = too_few(len(known), 2, "values")
    return {
        "people": len(known),
        "mean": plain(known.mean()) if len(known) else empty("nobody has a value"),
        "sd": plain(missing) if missing else plain(known.std(ddof=1)),
    }


def _mixed(
    cells: dict[tuple[str, str], tuple[float, int | None]],
    people: Sequence[str],
    names: Sequence[str],
) -> dict[str, Any]:
    """``y ~ condition + position`` with an intercept a person; everyone with any value counts."""
    keys = [(who, name) for who in people for name in names if (who, name) in cells]
    y = np.array([cells[key][0] for key in keys])
    columns: dict[str, FloatArray] = {
        name: np.array([float(key[1] == name) for key in keys]) for name in names[1:]
    }
    positions = [cells[key][1] for key in keys]
    ordered = all(position is not None for position in positions) and len(set(positions)) > 1
    if ordered:
        columns["position"] = np.array([float(position or 0) for position in positions])
    model = mixed_model(y, columns, np.array([float(people.index(who)) for who, _ in keys]))
    order = "in the model" if ordered else "not known, or the same for everyone: not in the model"
    if isinstance(model, NotComputable):
        return plain(model)
    test = model.joint_test(list(names[1:]))
    return {
        "reference": names[0],
        "order": order,
        "condition": plain(test._asdict()),
        "coefficients": [plain(coefficient) for coefficient in model.coefficients],
        "person_sd": plain(model.person_sd),
        "residual_sd": plain(model.residual_sd),
        "rows": model.rows,
    }


def _binary(
    table: FloatArray, names: Sequence[str], metric: str, rng: np.random.Generator
) -> dict[str, Any]:
    if metric != "success":
        return empty("not a matter of yes or no")
    if not np.isin(table, (0.0, 1.0)).all():
        return empty("success is a share of several drives, so it is compared by ranks and means")
    return {
        "cochran_q": plain(cochran_q(table, rng=rng)),
        "mcnemar": [plain(pair) for pair in all_pairs(table, names, mcnemar)],
    }


def _curves(
    values: Sequence[ConditionValue], names: Sequence[str], seed: int
) -> dict[str, list[dict[str, Any]]]:
    """Means by round with percentile bootstrap intervals over people."""
    curves: dict[str, list[dict[str, Any]]] = {}
    for name in names:
        by_round: dict[int, list[float]] = {}
        for value in values:
            if value.condition == name and value.round is not None:
                by_round.setdefault(value.round, []).append(value.value)
        curves[name] = []
        for number, known in sorted(by_round.items()):
            rng = np.random.default_rng([seed, len(known)])
            missing = too_few(len(known), 2, "values")
            curves[name].append(
                {
                    "round": number,
                    "people": len(known),
                    "mean": plain(np.mean(known)),
                    "ci95": plain(missing or mean_interval(np.array(known), rng)),
                    "too_few": mark(len(known), BANDS),
                }
            )
    return curves
