"""``steerlab``: the command line, and the only place where everything is put together.

Each verb is a typed function; what a verb needs is imported inside it, so that ``--help``
answers at once.
"""

import json
import logging
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro

if TYPE_CHECKING:
    from steerlab.analysis.summary import Summary

Noise = Literal["paper", "low", "human", "high"]
Preset = Literal["lab", "paper"]
Ladder = Literal["full", "quick"]
Out = Annotated[Path, tyro.conf.arg(metavar="DIR", help="Folder for the results.")]
Force = Annotated[bool, tyro.conf.arg(help="Replace the folder if it is not empty.")]
Seed = Annotated[int, tyro.conf.arg(help="The same seed gives the same labels and figures.")]
Json = Annotated[bool, tyro.conf.arg(help="Print the summary as JSON.")]


def demo(
    out: Out = Path("steerlab-demo"), seed: Seed = 0, force: Force = False, json: Json = False
) -> int:
    """A small simulated study from end to end, with a report to open; takes about a minute.

    Example: steerlab demo --out my-demo
    """
    return _simulate(
        out,
        force,
        json,
        teachers=16,
        new_teachers=16,
        noise="human",
        rollouts=8,
        ladder="quick",
        seed=seed,
    )


def simulate(
    out: Out,
    teachers: Annotated[int, tyro.conf.arg(help="Teachers the mapper is trained on.")] = 34,
    new_teachers: Annotated[int, tyro.conf.arg(help="Teachers it has never seen.")] = 34,
    noise: Annotated[Noise, tyro.conf.arg(help="How noisy the teachers are.")] = "human",
    rollouts: Annotated[int, tyro.conf.arg(help="Calibration rollouts, 4 to 12.")] = 12,
    preset: Annotated[Preset, tyro.conf.arg(help="Tuned settings, or the paper's own.")] = "lab",
    ladder: Annotated[
        Ladder, tyro.conf.arg(help="Rival mappers: all, or those that train no network.")
    ] = "full",
    seed: Seed = 0,
    force: Force = False,
    json: Json = False,
) -> int:
    """The whole calibration study with scripted teachers, headless, ending in a report.

    Example: steerlab simulate --teachers 34 --new-teachers 34 --noise human --seed 0 --out study
    """
    return _simulate(
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


def doctor(
    folder: Annotated[Path, tyro.conf.arg(help="Where you would keep studies.")] = Path("."),
    json: Json = False,
) -> int:
    """Check this machine: OpenGL and its speed, versions, disk; says how to mend what is wrong.

    Example: steerlab doctor
    """
    from dataclasses import asdict

    from steerlab.teleop.doctor import examine

    findings = examine(folder)
    if json:
        _print_json([asdict(finding) for finding in findings])
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
    from steerlab.sim.rollout_file import write_rollouts
    from steerlab.teleop.output_folder import OutputError

    if out.exists() and not force:
        raise OutputError(f"{out} exists; choose another file, or add --force to replace it.")
    with _progress() as progress:
        rollouts = generate_calibration_set(
            seed, on_rollout=lambda done, of: progress("driving rollouts", done / of)
        )
    write_rollouts(rollouts, out, made_by=f"steerlab calibration-set --seed {seed}")
    for rollout in rollouts:
        print(f"{rollout.name}  {rollout.steps} steps  {rollout.outcome}")
    print(f"Wrote {out}")
    return 0


def fit(
    labels: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="LABELS")],
    out: Out,
    folds: Annotated[int, tyro.conf.arg(help="Without a split column: how often to hold out.")] = 4,
    preset: Annotated[Preset, tyro.conf.arg(help="Tuned settings, or the paper's own.")] = "lab",
    limit: Annotated[float, tyro.conf.arg(help="Labels are within plus or minus this.")] = 2.5,
    rate_hz: Annotated[
        float | None, tyro.conf.arg(help="Steps a second, without a t_s column; 20 by default.")
    ] = None,
    seed: Seed = 0,
    force: Force = False,
    json: Json = False,
) -> int:
    """Learn from any table of labels, judge the result by cross-validation, and report.

    LABELS is a .csv or .parquet file with the columns person, rollout, step, label and truth;
    docs/fit.md has the format, docs/example-labels.csv an example.

    Example: steerlab fit docs/example-labels.csv --out my-fit
    """
    from steerlab.teleop.fit import FitConfig
    from steerlab.teleop.fit import fit as run

    config = FitConfig(folds=folds, preset=preset, seed=seed, limit=limit, rate_hz=rate_hz)
    given = {name: value for name, value in vars(config).items() if value is not None}
    command = _command("fit", given, out, labels.name)
    with _progress() as progress:
        summary = run(labels, config, out, force=force, command=command, progress=progress)
    return _say(summary, out, as_json=json)


def synthetic(
    out: Out,
    people: Annotated[int, tyro.conf.arg(help="Demonstrators the mapper is trained on.")] = 34,
    new_people: Annotated[int, tyro.conf.arg(help="Demonstrators it has never seen.")] = 34,
    seed: Seed = 0,
    force: Force = False,
    json: Json = False,
) -> int:
    """The paper's synthetic experiment, its figure 2, and our numbers beside its 61 % and 55 %.

    Example: steerlab synthetic --seed 0 --out my-synthetic
    """
    from steerlab.analysis.synthetic_report import comparison_lines
    from steerlab.learning.synthetic.experiment import SyntheticConfig
    from steerlab.teleop.synthetic import synthetic as run

    config = SyntheticConfig(people=people, new_people=new_people, seed=seed)
    given = {"people": people, "new_people": new_people, "seed": seed}
    command = _command("synthetic", given, out)
    with _progress() as progress:
        summary = run(config, out, force=force, command=command, progress=progress)
    if json:
        _print_json(summary.to_dict())
        return 0
    for line in comparison_lines(summary):
        print(line)
    _say_where(out)
    return 0


VERBS: dict[str, Callable[..., int]] = {
    "demo": demo,
    "simulate": simulate,
    "fit": fit,
    "synthetic": synthetic,
    "doctor": doctor,
    "calibration-set": calibration_set,
}


def main(arguments: list[str] | None = None) -> int:
    """Run one verb: 0 all well, 1 it found something wrong, 2 it could not be done."""
    from steerlab.sim.errors import SteerlabError

    logging.basicConfig(format="steerlab: %(message)s", level=logging.WARNING)
    arguments = sys.argv[1:] if arguments is None else arguments
    try:
        return tyro.extras.subcommand_cli_from_dict(
            VERBS,
            prog="steerlab",
            description="A driving lab for studying how people teach robots.",
            args=arguments or ["--help"],
        )
    except SteerlabError as error:
        print(f"steerlab: {error}", file=sys.stderr)
        return 2
    except OSError as error:
        where = f" {error.filename}" if error.filename else ""
        print(f"steerlab: {error.strerror or error}{where}; check the path.", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("steerlab: stopped; nothing was kept.", file=sys.stderr)
        return 130


def _simulate(out: Path, force: bool, as_json: bool, **settings: Any) -> int:
    from steerlab.teleop.population_run import PopulationConfig
    from steerlab.teleop.simulate import simulate as run

    config = PopulationConfig(**settings)
    command = _command("simulate", vars(config), out)
    with _progress() as progress:
        summary = run(config, out, force=force, command=command, progress=progress)
    return _say(summary, out, as_json=as_json)


def _command(verb: str, settings: Mapping[str, object], out: Path, *arguments: str) -> str:
    """The command line that gives the same results, with every setting spelt out."""
    options = [f"--{name.replace('_', '-')} {value}" for name, value in settings.items()]
    return " ".join(
        ["steerlab", verb, *map(quote, arguments), *options, f"--out {quote(out.name)}"]
    )


def _say(summary: "Summary", out: Path, *, as_json: bool) -> int:
    if as_json:
        _print_json(summary.to_dict())
        return 0
    from steerlab.analysis.wording import headline

    print(headline(summary))
    _say_where(out)
    return 0


def _say_where(out: Path) -> None:
    print(f"Report: {out / 'report' / 'index.html'}")
    print(f"Numbers: {out / 'summary.json'}")


@contextmanager
def _progress() -> Iterator[Callable[[str, float], None]]:
    """A progress bar on stderr for people; nothing where stderr is no terminal."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    console = Console(stderr=True)
    columns = (TextColumn("{task.description:<28}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console, disable=not console.is_terminal) as bar:
        tasks: dict[str, Any] = {}

        def show(what: str, share: float) -> None:
            if what not in tasks:
                tasks[what] = bar.add_task(what, total=1.0)
            bar.update(tasks[what], completed=share)

        yield show


def _print_json(values: object) -> None:
    print(json.dumps(values, indent=2, ensure_ascii=False))


if __name__ == "__main__":
    sys.exit(main())
