"""``steerlab synthetic``: the paper's synthetic experiment, written as one folder of results."""

from pathlib import Path
from time import perf_counter

import numpy as np

from steerlab.analysis.figures.synthetic import Demonstrators, ShownDrive, synthetic_figure
from steerlab.analysis.summary import SplitSummary, StyleSummary
from steerlab.analysis.synthetic_report import (
    SYNTHETIC_SPLITS,
    SyntheticReport,
    SyntheticSummary,
    render_synthetic_report,
)
from steerlab.learning.checkpoint import save_mapper
from steerlab.learning.synthetic.drives import WHEEL_PER_RAD, SyntheticDrive, Timing, label_drives
from steerlab.learning.synthetic.experiment import SyntheticConfig, SyntheticResult, run_synthetic
from steerlab.sim.files.output_folder import output_folder
from steerlab.sim.files.provenance import versions
from steerlab.sim.populations import PAPER
from steerlab.sim.progress import Progress
from steerlab.sim.scripted_teacher import ScriptedTeacher

_PROBED = {"gain": "log_gain", "delay": "delay_s"}  # summary name: what the probe calls it


def synthetic(
    config: SyntheticConfig, out: Path, *, force: bool, command: str, progress: Progress
) -> SyntheticSummary:
    """Run the experiment and write ``out``.

    Layout: ``models/mind_meld.safetensors``, ``report/index.html``, ``summary.json``.

    Args:
        command: the command line, for the report.

    Raises:
        SteerlabError: bad input or no place to write; nothing is left behind.
    """
    started = perf_counter()
    with output_folder(out, force=force) as folder:
        result = run_synthetic(config, progress)
        for name in ("models", "report"):
            (folder / name).mkdir()
        save_mapper(result.mapper, folder / "models" / "mind_meld.safetensors")
        progress("writing the report", 0.0)
        # The page shows its own numbers, so the clock stops before it is drawn.
        summary = summarise(result, result.seconds | {"before_report": perf_counter() - started})
        page = render_synthetic_report(compose_report(result, summary, command))
        (folder / "report" / "index.html").write_text(page, encoding="utf-8")
        (folder / "summary.json").write_text(summary.to_json(), encoding="utf-8")
        progress("writing the report", 1.0)
    return summary


def summarise(result: SyntheticResult, seconds: dict[str, float]) -> SyntheticSummary:
    """The numbers of ``summary.json``; mean errors are in radians."""
    return SyntheticSummary(
        seed=result.config.seed,
        versions=versions(),
        seconds=seconds,
        left_out=result.left_out,
        splits={
            split: SplitSummary.of(result.quality[split], unit=1.0 / WHEEL_PER_RAD)
            for split in SYNTHETIC_SPLITS
        },
        style={
            name: StyleSummary(
                probe_r2=result.probe_r2.get(probed), spearman_new=result.spearman_new.get(probed)
            )
            for name, probed in _PROBED.items()
        },
    )


def compose_report(
    result: SyntheticResult, summary: SyntheticSummary, command: str
) -> SyntheticReport:
    """The report of a run."""
    drives = sorted(result.calibration, key=lambda drive: -float(np.std(drive.truth_rad)))
    return SyntheticReport(
        summary=summary,
        interval={
            split: {method: quality.ci95 for method, quality in ladder.items()}
            for split, ladder in result.quality.items()
        },
        command=command,
        wheel_per_rad=WHEEL_PER_RAD,
        shift_s=PAPER.shift_s,
        magnitude=PAPER.magnitude,
        drive=drives[0].name,
        figure2=synthetic_figure(
            [drive.position_m[drive.labelled] for drive in drives],
            [drive.goal_m for drive in drives],
            _shown(result, drives[0]),
            _demonstrators(result, result.seen_people),
            _demonstrators(result, result.new_people),
        ),
    )


def _shown(result: SyntheticResult, drive: SyntheticDrive) -> ShownDrive:
    """A drive with the labels of the strongest over-corrector of each timing."""
    degrees = np.degrees(1.0 / WHEEL_PER_RAD)
    feedback: dict[str, np.ndarray] = {}
    mapped: dict[str, np.ndarray] = {}
    for timing in Timing:
        people = [person for person in result.seen_people if Timing.of(person) is timing]
        if people:
            strongest = max(people, key=lambda person: person.style.gain)
            (series,) = label_drives([strongest], [drive], result.rate_hz)
            feedback[str(timing)] = degrees * series.label
            mapped[str(timing)] = degrees * result.mapper.map(series)
    truth = drive.truth_rad[drive.labelled]
    return ShownDrive(
        t_s=np.arange(len(truth)) / result.rate_hz,
        truth_deg=np.degrees(truth),
        feedback_deg=feedback,
        mapped_deg=mapped,
    )


def _demonstrators(result: SyntheticResult, people: list[ScriptedTeacher]) -> Demonstrators:
    return Demonstrators(
        gain=np.array([person.style.gain for person in people]),
        delay_s=np.array([person.style.delay_s for person in people]),
        timing=[str(Timing.of(person)) for person in people],
        embeddings=result.embeddings(people),
    )
