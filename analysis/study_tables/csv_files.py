"""The tables as CSV files; a cell without a value is blank, and ``why_empty`` gives the reason."""

import csv
import io
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from steerlab.analysis.study_tables.plain import EMPTY, is_empty

Row = Mapping[str, Any]


def csv_files(tables: Mapping[str, Any]) -> dict[str, str]:
    """The text of each file, by its name."""
    quality = tables["label_quality"]
    return {
        "table1.csv": _text(() if is_empty(tables["table1"]) else map(_flat, tables["table1"])),
        "table2.csv": _text(map(_table2_row, tables["table2"]["rows"])),
        "table2_paper_compatible.csv": _text(_paper_rows(tables["table2"]["rows"])),
        "hypotheses.csv": _text(map(_hypothesis, tables["hypotheses"])),
        "style.csv": _text(map(_flat, tables["style"]["rows"])),
        "label_quality.csv": _text(_quality_rows(quality)),
        "conditions.csv": _text(_condition_rows(tables["conditions"])),
        "learning_curves.csv": _text(_curve_rows(tables["conditions"])),
        "exclusions.csv": _text(tables["exclusions"]["rows"]),
    }


def _flat(row: Row) -> dict[str, Any]:
    """Intervals as two columns, reasons of empty cells in ``why_empty``; nested parts left out."""
    flat: dict[str, Any] = {}
    reasons: list[str] = []
    for key, value in row.items():
        if is_empty(value):
            flat[key] = ""
            reasons.append(f"{key}: {value[EMPTY]}")
            if key.endswith("ci95"):
                flat |= {f"{key}_low": "", f"{key}_high": ""}
                del flat[key]
        elif _is_interval(value):
            flat |= {f"{key}_low": value[0], f"{key}_high": value[1]}
        elif not isinstance(value, list | Mapping):
            flat[key] = value
    return flat | {"why_empty": "; ".join(dict.fromkeys(reasons))}


def _table2_row(row: Row) -> dict[str, Any]:
    named: dict[str, Any] = {
        k: row[k] for k in ("key", "title", "family", "people", "left_out", "too_few")
    }
    for part, keys in (
        ("primary", ("r", "p", "interval", "adjusted_r2", "f_p")),
        ("networks", ("r", "p", "interval", "lowest", "highest", "networks")),
    ):
        for key in keys:
            name = "ci95" if key == "interval" else key
            named[f"{part}_{name}"] = row[part] if is_empty(row[part]) else row[part][key]
    rollouts = " ".join(row["rollouts"])
    return _flat(named | {"holm": row["holm"], "bh": row["bh"], "measured_on": rollouts})


def _paper_rows(rows: Sequence[Row]) -> Iterable[dict[str, Any]]:
    for row in rows:
        if is_empty(row["paper_compatible"]):
            yield _flat({"key": row["key"], "r": row["paper_compatible"]})
            continue
        for cell in row["paper_compatible"]:
            yield _flat({"key": row["key"], **cell, "why": "; ".join(cell.get("why", ()))})


def _hypothesis(row: Row) -> dict[str, Any]:
    effect, power = row["effect"], row["power"]
    none = is_empty(power)
    return _flat(
        {
            **{key: row[key] for key in ("id", "text", "primary", "planned", "test", "n")},
            "p": row["p"],
            "p_corrected": row["p_corrected"],
            "alpha": row["alpha"],
            "verdict": row["verdict"],
            "effect_what": effect if is_empty(effect) else effect["what"],
            "effect": effect if is_empty(effect) else effect["value"],
            "effect_ci95": effect if is_empty(effect) else effect["ci95"],
            "smallest_effect_80": power if none else power["smallest_effect_80"],
            "power_of_medium": power if none else power["of_medium"],
            "power_test": power if none else power["test"],
            "power_level": power if none else power["level"],
            "smallest_p": row.get("smallest_p", row["p"]),
            "why_not_testable": row.get("why"),
        }
    )


def _quality_rows(quality: Row) -> Iterable[dict[str, Any]]:
    for split, of_split in quality.items():
        if is_empty(of_split):
            yield {"split": split, "why_empty": of_split[EMPTY]}
            continue
        for person in of_split["by_person"]:
            yield _flat({"split": split, **person})


def _condition_rows(conditions: Row) -> Iterable[dict[str, Any]]:
    if not conditions["metrics"]:
        yield {"metric": "", "why_empty": conditions["why_empty"]}
    for metric, outcome in conditions["metrics"].items():
        for name, cell in outcome["means"].items():
            yield _flat({"metric": metric, "condition": name, **cell})


def _curve_rows(conditions: Row) -> Iterable[dict[str, Any]]:
    for metric, outcome in conditions["metrics"].items():
        for name, curve in outcome["curves"].items():
            for point in curve:
                yield _flat({"metric": metric, "condition": name, **point})


def _is_interval(value: Any) -> bool:
    numbers = isinstance(value, list) and len(value) == 2
    return numbers and all(isinstance(limit, int | float) for limit in value)


def _text(rows: Iterable[Row]) -> str:
    listed = list(rows)
    names = list(dict.fromkeys(key for row in listed for key in row))
    sink = io.StringIO()
    writer = csv.DictWriter(sink, names or ["why_empty"], restval="", lineterminator="\n")
    writer.writeheader()
    writer.writerows(listed)
    return sink.getvalue()
