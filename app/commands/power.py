"""The verb ``power``: how many people a study needs."""

import sys
from typing import Annotated, Any, Literal

import tyro

from steerlab.app.commands.arguments import (
    MANY,
    Force,
    Ints,
    Jobs,
    Json,
    Out,
    PathOrNone,
    Seed,
    Texts,
    decimal,
    whole,
    wholes,
)
from steerlab.app.commands.printing import print_json, progress_bar


def power(
    out: Out,
    people: Annotated[
        Ints, wholes("people", 1, MANY), tyro.conf.arg(help="Sample sizes to try, rising.")
    ] = (
        12,
        20,
        34,
        50,
        70,
        100,
        140,
    ),
    plant: Annotated[
        Texts,
        tyro.conf.arg(
            metavar="SCALE:STYLE:R",
            help="A correlation to find, such as mini_ipip_5.neuroticism:gain:0.4.",
        ),
    ] = (),
    conditions: Annotated[
        Texts,
        tyro.conf.arg(
            metavar="NAME:SHARE", help="Success of each condition, such as mind_meld:0.7."
        ),
    ] = (),
    taught: Annotated[
        PathOrNone,
        tyro.conf.arg(help="Draw outcomes from a teach run, or a table, instead of a model."),
    ] = None,
    ours: Annotated[
        str, tyro.conf.arg(help="The condition to be better than its rivals.")
    ] = "mind_meld",
    rollouts: Annotated[
        int, whole("rollouts", 1, MANY), tyro.conf.arg(help="Of the calibration.")
    ] = 12,
    noise: Annotated[
        Literal["paper", "low", "human", "high"], tyro.conf.arg(help="How noisy people are.")
    ] = "human",
    family: Annotated[
        int,
        whole("family", 1, MANY),
        tyro.conf.arg(help="Tests that Holm's correction goes over."),
    ] = 11,
    reliability: Annotated[
        float, decimal("reliability", 0.0, 1.0), tyro.conf.arg(help="Cronbach's alpha of scales.")
    ] = 0.8,
    dimensions: Annotated[int, whole("dimensions", 2, 100), tyro.conf.arg(help="Of w.")] = 4,
    starts: Annotated[
        int,
        whole("starts", 1, MANY),
        tyro.conf.arg(help="Evaluation drives a person and condition."),
    ] = 10,
    person_sd: Annotated[
        float, decimal("person-sd", 0.0, 100.0), tyro.conf.arg(help="How people differ, log odds.")
    ] = 0.5,
    interaction_sd: Annotated[
        float,
        decimal("interaction-sd", 0.0, 100.0),
        tyro.conf.arg(help="How much more under each condition, log odds."),
    ] = 0.5,
    studies: Annotated[
        int, whole("studies", 100, 100_000), tyro.conf.arg(help="Simulated for each sample size.")
    ] = 1000,
    alpha: Annotated[
        float, decimal("alpha", 0.0, 1.0), tyro.conf.arg(help="Level of each test.")
    ] = 0.05,
    seed: Seed = 0,
    jobs: Jobs = 1,
    force: Force = False,
    json: Json = False,
) -> int:
    """Power curves and the sample size for 80 and 90 %, from many simulated studies.

    Stopped, it goes on where it was when the same command is given again.

    Example: steerlab power --plant mini_ipip_5.neuroticism:gain:0.4 --out my-power
    """
    from steerlab.analysis.power_study.design import ConditionMean, Effect, PowerDesign
    from steerlab.analysis.power_study.report import needed_text
    from steerlab.app.commands.printing import command_line
    from steerlab.app.power import power as run

    settings: dict[str, Any] = {
        "people": people, "rollouts": rollouts, "noise": noise, "family": family,
        "reliability": reliability, "dimensions": dimensions, "starts": starts,
        "person_sd": person_sd, "interaction_sd": interaction_sd, "studies": studies,
        "alpha": alpha, "seed": seed, "ours": ours,
    }  # fmt: skip
    design = PowerDesign(
        **settings,
        effects=tuple(map(Effect.parse, plant)),
        conditions=tuple(map(ConditionMean.parse, conditions)),
    )
    given = dict(settings)
    for name, several in (("plant", plant), ("conditions", conditions)):
        given |= {name: several} if several else {}
    given |= {"taught": taught.name} if taught else {}
    command = command_line("power", given, out)
    try:
        with progress_bar() as progress:
            summary = run(
                design, out, command=command, progress=progress, jobs=jobs, taught=taught,
                force=force,
            )  # fmt: skip
    except KeyboardInterrupt:
        print(
            "steerlab: stopped; what was simulated is kept. Give the same command again to go on.",
            file=sys.stderr,
        )
        return 130
    if json:
        print_json(summary)
        return 0
    print(f"{'test':<44}{'80 %':>18}{'90 %':>18}")
    for curve in summary["curves"]:
        cells = [curve[key] for key in ("people_for_80", "people_for_90")]
        texts = ["not reached" if "empty" in cell else needed_text(cell) for cell in cells]
        print(f"{curve['test']:<44}{texts[0]:>18}{texts[1]:>18}")
    print(f"Report: {out / 'report' / 'index.html'}")
    print(f"Numbers: {out / 'summary.json'}")
    return 0
