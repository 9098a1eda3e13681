"""``steerlab synthetic``: the paper's synthetic experiment."""

from typing import Annotated

import tyro

from steerlab.app.commands.arguments import MANY, Force, Json, Out, Seed, whole
from steerlab.app.commands.printing import command_line, print_json, print_where, progress_bar


def synthetic(
    out: Out,
    people: Annotated[
        int,
        whole("people", 6, MANY),
        tyro.conf.arg(help="Demonstrators the mapper is trained on."),
    ] = 34,
    new_people: Annotated[
        int, whole("new-people", 2, MANY), tyro.conf.arg(help="Demonstrators it has never seen.")
    ] = 34,
    seed: Seed = 0,
    force: Force = False,
    json: Json = False,
) -> int:
    """The paper's synthetic experiment, its figure 2, and our numbers beside its 61 % and 55 %.

    Example: steerlab synthetic --seed 0 --out my-synthetic
    """
    from steerlab.analysis.synthetic_report import comparison_lines
    from steerlab.app.synthetic import synthetic as run
    from steerlab.learning.synthetic.experiment import SyntheticConfig

    config = SyntheticConfig(people=people, new_people=new_people, seed=seed)
    given = {"people": people, "new_people": new_people, "seed": seed}
    command = command_line("synthetic", given, out)
    with progress_bar() as progress:
        summary = run(config, out, force=force, command=command, progress=progress)
    if json:
        print_json(summary.to_dict())
        return 0
    for line in comparison_lines(summary):
        print(line)
    print_where(out)
    return 0
