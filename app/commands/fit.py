"""``steerlab fit``: learn from any table of labels."""

from pathlib import Path
from typing import Annotated

import tyro

from steerlab.app.commands.arguments import (
    FloatOrNone,
    Force,
    Json,
    Ladder,
    Out,
    Preset,
    Seed,
    decimal,
    whole,
)
from steerlab.app.commands.printing import command_line, print_summary, progress_bar


def fit(
    labels: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="LABELS")],
    out: Out,
    folds: Annotated[
        int,
        whole("folds", 2, 1000),
        tyro.conf.arg(help="Without a split column: how often to hold out."),
    ] = 4,
    preset: Annotated[Preset, tyro.conf.arg(help="Tuned settings, or the paper's own.")] = "lab",
    ladder: Annotated[
        Ladder, tyro.conf.arg(help="Rival mappers: all, or those that are fitted in seconds.")
    ] = "full",
    limit: Annotated[
        float,
        decimal("limit", 1e-6, 1e6),
        tyro.conf.arg(help="Labels are within plus or minus this."),
    ] = 2.5,
    rate_hz: Annotated[
        FloatOrNone,
        decimal("rate-hz", 0.001, 1e6),
        tyro.conf.arg(help="Steps a second, without a t_s column; 20 by default."),
    ] = None,
    gain: Annotated[
        FloatOrNone,
        decimal("gain", 1e-6, 1e6),
        tyro.conf.arg(help="Of a tracked cursor: its speed to one unit of input; 1 by default."),
    ] = None,
    seed: Seed = 0,
    force: Force = False,
    json: Json = False,
) -> int:
    """Learn from any table of labels, judge the result by cross-validation, and report.

    LABELS is a .csv or .parquet file with the columns person, rollout, step, label and truth;
    docs/fit.md has the format, docs/example-labels.csv an example. People who tracked with a
    cursor: reference, disturbance and input in place of label and truth, as in
    docs/example-tracking.csv.

    Example: steerlab fit docs/example-labels.csv --out my-fit
    """
    from steerlab.app.fit import FitConfig
    from steerlab.app.fit import fit as run

    config = FitConfig(
        folds=folds,
        preset=preset,
        ladder=ladder,
        seed=seed,
        limit=limit,
        rate_hz=rate_hz,
        gain=gain,
    )
    given = {name: value for name, value in vars(config).items() if value is not None}
    command = command_line("fit", given, out, labels.name)
    with progress_bar() as progress:
        summary = run(labels, config, out, force=force, command=command, progress=progress)
    return print_summary(summary, out, as_json=json)
