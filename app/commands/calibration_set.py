"""``steerlab calibration-set``: make the twelve rollouts again."""

from pathlib import Path
from typing import Annotated

import tyro

from steerlab.app.commands.arguments import MAX_SEED, whole
from steerlab.app.commands.printing import progress_bar


def calibration_set(
    out: Annotated[Path, tyro.conf.arg(metavar="FILE", help="Where to write the rollouts.")],
    seed: Annotated[
        int, whole("seed", 0, MAX_SEED), tyro.conf.arg(help="12 gives the shipped set.")
    ] = 12,
    force: Annotated[bool, tyro.conf.arg(help="Replace the file if it exists.")] = False,
) -> int:
    """Make the twelve wizard-of-Oz rollouts that participants correct; the shipped set has seed 12.

    Example: steerlab calibration-set --seed 12 --out calibration_set.parquet
    """
    from steerlab.sim.calibration_generator import generate_calibration_set
    from steerlab.sim.calibration_set import write_rollouts
    from steerlab.sim.files.output_folder import OutputError, check_output_file

    if out.exists() and not force:
        raise OutputError(f"{out} exists; choose another file, or add --force to replace it.")
    check_output_file(out)
    with progress_bar() as progress:
        rollouts = generate_calibration_set(
            seed, on_rollout=lambda done, of: progress("driving rollouts", done / of)
        )
    write_rollouts(rollouts, out, made_by=f"steerlab calibration-set --seed {seed}")
    for rollout in rollouts:
        print(f"{rollout.name}  {rollout.steps} steps  {rollout.outcome}")
    print(f"Wrote {out}")
    return 0
