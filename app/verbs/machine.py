"""Verbs about this machine and the shipped data: ``doctor`` and ``calibration-set``."""

from pathlib import Path
from typing import Annotated

import tyro

from steerlab.app.verbs.common import Json, print_json, progress_bar


def doctor(
    folder: Annotated[Path, tyro.conf.arg(help="Where you would keep studies.")] = Path("."),
    loop: Annotated[
        bool, tyro.conf.arg(help="Also run the whole loop, and say if it keeps time.")
    ] = False,
    seconds: Annotated[float, tyro.conf.arg(help="How long to run the loop.")] = 20.0,
    json: Json = False,
) -> int:
    """Check this machine: OpenGL and its speed, versions, disk, timing; says how to mend it.

    With --loop a virtual wheel steers through the calibration set, on screen if there is one, and
    everything is recorded in a throw-away study, as in a session.

    Example: steerlab doctor --loop
    """
    from dataclasses import asdict

    from steerlab.app.doctor import examine

    findings = examine(folder)
    if loop:
        from steerlab.app.doctor_loop import examine_loop

        with progress_bar() as progress:
            findings += examine_loop(folder, seconds, progress)
    if json:
        print_json([asdict(finding) for finding in findings])
    else:
        width = max(len(finding.what) for finding in findings)
        for finding in findings:
            print(f"{'ok  ' if finding.ok else 'BAD '} {finding.what:<{width}}  {finding.found}")
            if finding.mend:
                print(f"     {'':<{width}}  mend: {finding.mend}")
    return 0 if all(finding.ok for finding in findings) else 1


def calibration_set(
    out: Annotated[Path, tyro.conf.arg(metavar="FILE", help="Where to write the rollouts.")],
    seed: Annotated[int, tyro.conf.arg(help="12 gives the shipped set.")] = 12,
    force: Annotated[bool, tyro.conf.arg(help="Replace the file if it exists.")] = False,
) -> int:
    """Make the twelve wizard-of-Oz rollouts that participants correct; the shipped set has seed 12.

    Example: steerlab calibration-set --seed 12 --out calibration_set.parquet
    """
    from steerlab.sim.calibration_generator import generate_calibration_set
    from steerlab.sim.files.output_folder import OutputError
    from steerlab.sim.rollout_file import write_rollouts

    if out.exists() and not force:
        raise OutputError(f"{out} exists; choose another file, or add --force to replace it.")
    with progress_bar() as progress:
        rollouts = generate_calibration_set(
            seed, on_rollout=lambda done, of: progress("driving rollouts", done / of)
        )
    write_rollouts(rollouts, out, made_by=f"steerlab calibration-set --seed {seed}")
    for rollout in rollouts:
        print(f"{rollout.name}  {rollout.steps} steps  {rollout.outcome}")
    print(f"Wrote {out}")
    return 0
