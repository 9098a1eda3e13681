"""``steerlab simulate``: the whole calibration study with scripted teachers."""

from pathlib import Path
from typing import Annotated, Any

import tyro

from steerlab.app.commands.arguments import (
    MANY,
    Force,
    Json,
    Ladder,
    Noise,
    Out,
    Preset,
    Seed,
    check_encoding,
    whole,
)
from steerlab.app.commands.printing import command_line, print_summary, progress_bar


def simulate(
    out: Out,
    teachers: Annotated[
        int, whole("teachers", 3, MANY), tyro.conf.arg(help="Teachers the mapper is trained on.")
    ] = 34,
    new_teachers: Annotated[
        int, whole("new-teachers", 2, MANY), tyro.conf.arg(help="Teachers it has never seen.")
    ] = 34,
    noise: Annotated[Noise, tyro.conf.arg(help="Which population the teachers are of.")] = "human",
    rollouts: Annotated[
        int, whole("rollouts", 4, 1000), tyro.conf.arg(help="Calibration rollouts, 4 to 12.")
    ] = 12,
    preset: Annotated[Preset, tyro.conf.arg(help="Tuned settings, or the paper's own.")] = "lab",
    ladder: Annotated[
        Ladder, tyro.conf.arg(help="Rival mappers: all, or those that are fitted in seconds.")
    ] = "full",
    seed: Seed = 0,
    force: Force = False,
    json: Json = False,
) -> int:
    """The whole calibration study with scripted teachers, headless, ending in a report.

    Example: steerlab simulate --teachers 34 --new-teachers 34 --noise human --seed 0 --out study
    """
    return simulate_population(
        out,
        force,
        json,
        teachers=teachers,
        new_teachers=new_teachers,
        noise=noise,
        rollouts=rollouts,
        preset=preset,
        ladder=ladder,
        seed=seed,
    )


def simulate_population(out: Path, force: bool, as_json: bool, **settings: Any) -> int:
    """Run, and print the summary; ``settings`` are those of ``PopulationRunConfig``."""
    from steerlab.app.population_run import PopulationRunConfig
    from steerlab.app.simulate import simulate as run

    check_encoding(out)  # also of the folder in which demo puts its own
    config = PopulationRunConfig(**settings)
    command = command_line("simulate", vars(config), out)
    with progress_bar() as progress:
        summary = run(config, out, force=force, command=command, progress=progress)
    return print_summary(summary, out, as_json=as_json)
