"""``steerlab doctor``: what this machine can do."""

from pathlib import Path
from typing import Annotated

import tyro

from steerlab.app.commands.arguments import Json, decimal
from steerlab.app.commands.printing import print_json, progress_bar


def doctor(
    folder: Annotated[Path, tyro.conf.arg(help="Where you would keep studies.")] = Path("."),
    loop: Annotated[
        bool, tyro.conf.arg(help="Also run the whole loop, and say if it keeps time.")
    ] = False,
    seconds: Annotated[
        float, decimal("seconds", 0.0, 86_400.0), tyro.conf.arg(help="How long to run the loop.")
    ] = 20.0,
    json: Json = False,
) -> int:
    """Check this machine: OpenGL and its speed, versions, disk, timing; says how to mend it.

    With --loop a virtual wheel steers through the calibration set, on screen if there is one, and
    everything is recorded in a throw-away study, as in a session.

    Example: steerlab doctor --loop
    """
    from dataclasses import asdict

    from steerlab.app.doctor import examine

    checks = examine(folder)
    if loop:
        from steerlab.app.loop_check import examine_loop

        with progress_bar() as progress:
            checks += examine_loop(folder, seconds, progress)
    if json:
        print_json([asdict(check) for check in checks])
    else:
        width = max(len(check.what) for check in checks)
        for check in checks:
            print(f"{'ok  ' if check.ok else 'BAD '} {check.what:<{width}}  {check.found}")
            if check.mend:
                print(f"     {'':<{width}}  mend: {check.mend}")
    return 0 if all(check.ok for check in checks) else 1
