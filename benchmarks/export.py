"""How long an export takes, on a scripted study made once. ``python -m benchmarks.export [STUDY]``."""

import sys
import tempfile
from pathlib import Path
from time import perf_counter

from benchmarks.rows import Row, at_most, print_rows
from steerlab.analysis.export.bundle import FORMATS, ExportConfig, Format
from steerlab.app.export import export
from steerlab.study.contract import Role
from steerlab.study.runner import RunConfig
from steerlab.study.scripted import ScriptedParticipant
from steerlab.study.study import Study
from steerlab.study.study_folder import new_study
from steerlab.study.teaching.contract import all_teachings

TRAINING, TEST = 12, 6
LIMIT_S = 20.0
_QUICKER = (  # how well robots learn does not change how long their data take
    ('preset = "lab"', 'preset = "lab"\nepochs = 5'),
    ("gradient_steps = 150 ", "gradient_steps = 20 "),
    ("starts = 10 ", "starts = 4 "),
)


def run() -> list[Row]:
    """One row a figure; making the study takes about ten minutes."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "study"
        make(folder)
        return measured(folder)


def make(folder: Path) -> None:
    """A study of the shipped template, all phases done by scripted participants."""
    new_study(folder, "mind-meld")
    text = (folder / "study.toml").read_text()
    for before, after in _QUICKER:
        assert before in text, before
        text = text.replace(before, after)
    (folder / "study.toml").write_text(text)
    with Study.open(folder) as study:
        for seed in range(TRAINING + TEST):
            script = ScriptedParticipant(kind="human", seed=seed)
            config = RunConfig(
                device=script.device, pages=script, recordings=False, teachings=all_teachings()
            )
            study.run(study.enrol(Role.TRAINING if seed < TRAINING else Role.TEST).id, config)


def measured(folder: Path) -> list[Row]:
    """The export of a study that is there, format by format and in all."""
    with tempfile.TemporaryDirectory() as name:
        rows: list[Row] = []
        choices: list[tuple[Format, ...]] = [*((one,) for one in FORMATS), FORMATS]
        for formats in choices:
            config = ExportConfig(formats=formats)
            started = perf_counter()
            summary = export(
                folder,
                config,
                Path(name) / "+".join(formats),
                force=False,
                progress=lambda what, share: None,
            )
            took_s = perf_counter() - started
            people, steps = summary["participants"], summary["rows"]["labels"]
            what = f"{' and '.join(formats) if len(formats) == 1 else 'all formats'}"
            rows.append(at_most(f"{what}, {people} people, {steps} steps", took_s, LIMIT_S, "s"))
        return rows


if __name__ == "__main__":
    given = sys.argv[1:]
    raise SystemExit(print_rows(measured(Path(given[0])) if given else run()))
