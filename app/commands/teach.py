"""The verb ``teach``: interactive learners side by side."""

import sys
from typing import Annotated, Any, Literal, Optional

import tyro

from steerlab.app.commands.arguments import (
    MANY,
    Force,
    Jobs,
    Json,
    Out,
    PathOrNone,
    Seed,
    Texts,
    decimal,
    whole,
)
from steerlab.app.commands.printing import print_json, print_where, progress_bar

Noise = Annotated[
    float,
    decimal("noise", 0.0, 10.0),
    tyro.conf.arg(help="Wheel noise: standard deviation, wheel units of ±2.5."),
]


def teach(
    out: Out,
    learners: Annotated[
        Texts, tyro.conf.arg(help="Learners to compare; an unknown one lists all.")
    ] = ("bc", "dagger", "mind-meld", "mind-meld-mean", "oracle"),
    teachers: Annotated[
        int,
        whole("teachers", 1, MANY),
        tyro.conf.arg(help="Scripted teachers the mapper never saw."),
    ] = 20,
    rounds: Annotated[
        int, whole("rounds", 1, 1000), tyro.conf.arg(help="Rounds after the demonstration.")
    ] = 12,
    task: Annotated[
        str, tyro.conf.arg(help="easy, slalom, hard or generated-<number>.")
    ] = "slalom",
    noise: Noise = 0.5,
    speed_mps: Annotated[
        float, decimal("speed-mps", 0.1, 100.0), tyro.conf.arg(help="Cruising speed.")
    ] = 5.0,
    learner_seeds: Annotated[
        int,
        whole("learner-seeds", 1, 1000),
        tyro.conf.arg(help="Learners a teacher and condition."),
    ] = 3,
    seed: Seed = 0,
    population: Annotated[
        Optional[  # noqa: UP045 - see quick_types
            Literal["wide", "paper", "low", "human", "high", "people", "sparse"]
        ],
        tyro.conf.arg(help="How much teachers differ; else wide, or human for other families."),
    ] = None,
    family: Annotated[
        Literal[
            "scripted", "asymmetric", "bang-bang", "dither", "late-braking", "fatigue", "sparse"
        ],
        tyro.conf.arg(help="Kind of test teacher; all but scripted are new in kind to the mapper."),
    ] = "scripted",
    driving: Annotated[
        Literal["softened", "raw"],
        tyro.conf.arg(help="How teachers drive; raw: as clumsily as they correct."),
    ] = "softened",
    inputs: Annotated[
        Literal["image+state", "image", "state"], tyro.conf.arg(help="What policies see.")
    ] = "image+state",
    training_steps: Annotated[
        int,
        whole("training-steps", 1, 100_000),
        tyro.conf.arg(help="Gradient steps of a policy in each round."),
    ] = 150,
    mapper: Annotated[
        PathOrNone, tyro.conf.arg(help="A MIND MELD model instead of one trained here.")
    ] = None,
    engine: Annotated[Literal["local"], tyro.conf.arg(help="Where it runs.")] = "local",
    jobs: Jobs = 1,
    force: Force = False,
    json: Json = False,
) -> int:
    """Does a better label make a better driver? Learners, teachers and rounds compared.

    Stopped, it goes on where it was when the same command is given again.

    Example: steerlab teach --learners bc dagger mind-meld oracle --teachers 4 --out taught
    """
    from steerlab.sim.engine.gl import draw_without_threads

    draw_without_threads()  # before the next lines import MuJoCo
    from steerlab.app.commands.printing import command_line
    from steerlab.app.teach import teach as run
    from steerlab.app.teach_config import TeachConfig

    population = population or ("wide" if family == "scripted" else "human")
    config = TeachConfig(
        learners=learners, teachers=teachers, rounds=rounds, task=task, noise=noise,
        speed_mps=speed_mps, learner_seeds=learner_seeds, seed=seed, population=population,
        family=family, driving=driving, inputs=inputs, training_steps=training_steps,
    )  # fmt: skip
    given: dict[str, Any] = {
        "learners": learners, "teachers": teachers, "rounds": rounds, "task": task,
        "noise": noise, "speed_mps": speed_mps, "learner_seeds": learner_seeds, "seed": seed,
        "population": population, "family": family, "driving": driving, "inputs": inputs,
        "training_steps": training_steps,
    }  # fmt: skip
    if mapper is not None:
        given["mapper"] = mapper
    command = command_line("teach", given, out)
    try:
        with progress_bar(time_left=True) as progress:
            summary = run(
                config, out, command=command, progress=progress, jobs=jobs, mapper=mapper,
                force=force,
            )  # fmt: skip
    except KeyboardInterrupt:
        print(
            "steerlab: stopped; whatever learner a teacher had finished is kept. Give the same "
            "command again to go on.",
            file=sys.stderr,
        )
        return 130
    if json:
        print_json(summary)
        return 0
    from steerlab.analysis.teach_report import table_lines

    for line in table_lines(summary):
        print(line)
    print_where(out)
    return 0
