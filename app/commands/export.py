"""The verb ``export``: a study's data as CSV, SPSS, Parquet or a Psych-DS dataset."""

from pathlib import Path
from typing import Annotated

import tyro

from steerlab.app.commands.arguments import Force, Json, PathOrNone, Words, words
from steerlab.app.commands.printing import print_json, progress_bar


def export(
    study: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="STUDY")],
    format: Annotated[
        Words,
        words("format", ("csv", "spss", "parquet", "psych-ds")),
        tyro.conf.arg(help="One or more of them."),
    ],
    out: Annotated[
        PathOrNone,
        tyro.conf.arg(metavar="DIR", help="Folder to make; by default in the study's exports/."),
    ] = None,
    free_text: Annotated[
        bool, tyro.conf.arg(help="Also what participants wrote in their own words.")
    ] = False,
    withdrawn: Annotated[
        bool, tyro.conf.arg(help="Also those who withdrew and let their data be kept.")
    ] = False,
    force: Force = False,
    json: Json = False,
) -> int:
    """A study's data for R, SPSS, JASP, pandas and others, with a codebook.

    A row a participant, and long tables of answers, scores, attempts, labels, rounds and drives.
    Participants are pseudonyms; who withdrew is left out.

    Example: steerlab export my-study --format csv spss
    """
    from steerlab.analysis.export.bundle import FORMATS, ExportConfig, Format
    from steerlab.app.export import default_out
    from steerlab.app.export import export as run

    chosen: tuple[Format, ...] = tuple(one for one in FORMATS if one in format)
    config = ExportConfig(formats=chosen, free_text=free_text, with_withdrawn=withdrawn)
    with progress_bar() as progress:
        summary = run(study, config, out, force=force, progress=progress)
    if json:
        print_json(summary)
        return 0
    place = default_out(study, config) if out is None else out
    print(f"{summary['participants']} participants, of whom {summary['counted']} count")
    for line in summary["notices"]:
        print(line)
    print(f"Data: {place}")
    print(f"What each file is: {place / 'README.txt'}")
    return 0
