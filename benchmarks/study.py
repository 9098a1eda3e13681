"""A study's own work: finding w, enrolling, the checks. ``python -m benchmarks.study``."""

import tempfile
from pathlib import Path
from statistics import median
from time import perf_counter

from benchmarks.rows import Row, at_most, print_rows
from steerlab.study.contract import PhaseKind, Role
from steerlab.study.runner import RunConfig
from steerlab.study.scripted import ScriptedParticipant
from steerlab.study.study import Study
from steerlab.study.study_folder import new_study

TRAINING, TEST = 8, 3
EPOCHS = 5  # what the network is worth does not change how long w takes


def run() -> list[Row]:
    """One row a figure."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "study"
        new_study(folder, "mind-meld")
        text = (folder / "study.toml").read_text()
        text = text.replace('preset = "lab"', f'preset = "lab"\nepochs = {EPOCHS}')
        (folder / "study.toml").write_text(text)
        with Study.open(folder) as study:
            for seed in range(TRAINING):
                _go(study, Role.TRAINING, seed, until=None)
            study.train(lambda what, share: None)
            found_s, enrol_ms = [], []
            for seed in range(TRAINING, TRAINING + TEST):
                who, took_ms = _go(study, Role.TEST, seed, until=PhaseKind.CALIBRATE_W)
                enrol_ms.append(took_ms)
                started = perf_counter()
                study.run(who, RunConfig(device="wheel", phase="calibrate-w", recordings=False))
                found_s.append(perf_counter() - started)
            started = perf_counter()
            study.verify()
            checks_ms = 1e3 * (perf_counter() - started)
    return [
        at_most("w after the calibration phase, slowest", max(found_s), 1.0, "s"),
        at_most("enrolling, median", median(enrol_ms), 100.0, "ms"),
        at_most(f"all checks of {TRAINING + TEST} people", checks_ms, 1000.0, "ms"),
    ]


def _go(study: Study, role: Role, seed: int, *, until: PhaseKind | None) -> tuple[str, float]:
    """A new scripted participant, as far as a phase of the kind ``until``.

    Returns:
        who, and the milliseconds that enrolling took.
    """
    script = ScriptedParticipant(kind="human", seed=seed)
    started = perf_counter()
    who = study.enrol(role).id
    took_ms = 1e3 * (perf_counter() - started)
    while (phase := study.participant(who).next_phase) is not None and phase.kind is not until:
        config = RunConfig(device=script.device, pages=script, phase=phase.id, recordings=False)
        study.run(who, config)
    return who, took_ms


if __name__ == "__main__":
    raise SystemExit(print_rows(run()))
