"""The verb ``analyze``: tables, figures and hypotheses of a study."""

from pathlib import Path
from typing import Annotated

import tyro

from steerlab.app.commands.arguments import MAX_SEED, Force, Json, PathOrNone, whole
from steerlab.app.commands.printing import print_json, progress_bar, quoted


def analyze(
    study: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="STUDY")],
    out: Annotated[
        PathOrNone,
        tyro.conf.arg(metavar="DIR", help="Where report/ goes; by default into the study."),
    ] = None,
    conditions: Annotated[
        PathOrNone,
        tyro.conf.arg(help="Outcomes of conditions: a .csv or .parquet, or a teach run's folder."),
    ] = None,
    seeds: Annotated[
        int,
        whole("seeds", 0, 1000),
        tyro.conf.arg(help="Networks trained without the held-out rollouts; 0 for none."),
    ] = 1,
    fastdtw: Annotated[
        bool, tyro.conf.arg(help="Also the paper's fastdtw, radius 10; takes minutes.")
    ] = False,
    permutations: Annotated[
        int,
        whole("permutations", 19, 1_000_000),
        tyro.conf.arg(help="Of each permutation test."),
    ] = 9999,
    seed: Annotated[
        int, whole("seed", 0, MAX_SEED), tyro.conf.arg(help="Of permutations and resamples.")
    ] = 0,
    force: Force = False,
    json: Json = False,
) -> int:
    """Every table, figure and hypothesis test of the paper, and a report to publish from.

    STUDY is the folder of a study, of people or scripted, or of a simulate run.

    Example: steerlab analyze my-study
    """
    from steerlab.analysis.study_tables.tables import AnalysisConfig
    from steerlab.app.analyze import AnalyzeConfig, default_out
    from steerlab.app.analyze import analyze as run

    config = AnalyzeConfig(
        analysis=AnalysisConfig(seed=seed, permutations=permutations, fastdtw=fastdtw),
        networks=seeds,
        conditions=conditions,
    )
    given = [f"--seeds {seeds}", f"--permutations {permutations}", f"--seed {seed}"]
    given += [f"--conditions {quoted(conditions.name)}"] if conditions else []
    given += ["--fastdtw"] if fastdtw else []
    command = " ".join(["steerlab analyze", quoted(study.name), *given])
    folder = default_out(study) if out is None else out
    with progress_bar() as progress:
        summary = run(study, config, folder, force=force, command=command, progress=progress)
    if json:
        print_json(summary)
        return 0
    for name, hypothesis in summary["hypotheses"].items():
        print(f"{name:<4} {hypothesis['verdict']}")
    for line in summary["deviations"]:
        print(f"Deviates from the plan: {line}")
    print(f"Report: {folder / 'report' / 'index.html'}")
    print(f"Tables: {folder / 'report' / 'tables.json'}")
    return 0
