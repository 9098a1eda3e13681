"""Every reader of a file that steerlab writes, or takes from people, with a file as its writer makes it."""

import random
import shutil
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pyarrow.csv as pv

from steerlab.analysis.export.bundle import ExportConfig
from steerlab.analysis.power_study.design import PowerDesign
from steerlab.analysis.power_study.simulated_studies import BLOCK
from steerlab.analysis.study_data.conditions_file import left_out_teachers, read_conditions
from steerlab.analysis.study_data.population import read_population
from steerlab.analysis.study_data.study import read_study
from steerlab.app import power as power_run
from steerlab.app.export import default_out, export
from steerlab.app.packed_export import packed
from steerlab.app.population_run import PopulationRunConfig
from steerlab.app.simulate import simulate
from steerlab.app.teach import teach
from steerlab.app.teach_config import TeachConfig
from steerlab.app.teach_shards import read_shard
from steerlab.learning import presets
from steerlab.learning.checkpoint import load_mapper, save_mapper
from steerlab.learning.label_file import read_label_columns
from steerlab.learning.label_table import LabelScale, label_table
from steerlab.learning.mapper import MindMeldMapper
from steerlab.learning.policy import load_policy
from steerlab.learning.pretrained.weights import load_model, load_shipped_model, save_model
from steerlab.learning.series import series_from_table
from steerlab.learning.splits import plan_folds
from steerlab.sim.calibration_set import load_calibration_set, read_rollouts, write_rollouts
from steerlab.sim.files.structured import utf8_text
from steerlab.sim.populations import sample_population
from steerlab.sim.records import labelled_table
from steerlab.sim.rollout import Rollout
from steerlab.sim.shards import read_shards, write_shard
from steerlab.study.contract import Role
from steerlab.study.derived import derived_files, left_of
from steerlab.study.protocol_file import parse_protocol, study_questionnaires
from steerlab.study.study import Study
from steerlab.study.surveys.questionnaire_file import questionnaire_from_toml
from steerlab.teleop.devices.profile_folder import (
    profile_from_toml,
    profile_to_toml,
    shipped_profiles,
)
from steerlab.teleop.devices.trace import read_trace
from steerlab.teleop.loop import label_rollout
from tests.faults.mutations import (
    damage_database,
    damage_parquet,
    damaged_bytes,
    damaged_json,
    damaged_tensors,
)

Damage = Callable[[Path, random.Random], Any]


@dataclass(frozen=True, kw_only=True)
class Reader:
    """A reader and its file.

    Attributes:
        write: makes what is read in an empty folder, by the program's own writer; returns what to
            give to ``read``.
        read: returns a value or raises ``SteerlabError``; nothing else.
        damaged: which file of it is damaged, from what ``write`` returned.
        share: of all fuzz cases, relative to the others.
    """

    name: str
    write: Callable[[Path], Path]
    read: Callable[[Path], object]
    damage: Damage
    damaged: Callable[[Path], Path] = lambda path: path
    share: float = 1.0


def bytes_of(path: Path, rng: random.Random) -> None:
    path.write_bytes(damaged_bytes(path.read_bytes(), rng))


def json_of(path: Path, rng: random.Random) -> None:
    damage = rng.choice((damaged_bytes, damaged_json))
    path.write_bytes(damage(path.read_bytes(), rng))


def tensors_of(path: Path, rng: random.Random) -> None:
    path.write_bytes(damaged_tensors(path.read_bytes(), rng))


def database_of(path: Path, rng: random.Random) -> None:
    if rng.random() < 0.2:
        bytes_of(path, rng)
    else:
        damage_database(path, rng)


def _silent(what: str, share: float) -> None:
    pass


def _rollouts() -> tuple[Rollout, ...]:
    """The two shortest."""
    return tuple(sorted(load_calibration_set(), key=lambda rollout: rollout.steps)[:2])


def _labels(folder: Path) -> Path:
    (folder / "labels").mkdir()
    for person in sample_population("human", 2, 0, prefix="p"):
        for order, rollout in enumerate(_rollouts()):
            labels = label_rollout(rollout, person, order=order)
            table = labelled_table(rollout, labels, participant=person.name)
            write_shard(table, folder / "labels" / f"{person.name}-{rollout.name}.parquet")
    return folder / "labels"


def _label_csv(folder: Path) -> Path:
    table = read_shards(_labels(folder))
    pv.write_csv(table, folder / "labels.csv")
    return folder / "labels.csv"


def _label_parquet(folder: Path) -> Path:
    write_shard(read_shards(_labels(folder)), folder / "labels.parquet")
    return folder / "labels.parquet"


def _read_labels(path: Path) -> object:
    return plan_folds(label_table(read_label_columns(path), LabelScale()), 2, 0)


def _rollout_file(folder: Path) -> Path:
    write_rollouts(_rollouts(), folder / "rollouts.parquet", made_by="a test")
    return folder / "rollouts.parquet"


def _mapper(folder: Path) -> Path:
    series = series_from_table(read_shards(_labels(folder)))
    lab = presets.LAB
    quick = replace(lab, training=replace(lab.training, epochs=1, least_per_epoch=1))
    mapper = MindMeldMapper(quick, seed=0)
    mapper.fit(series)
    mapper.calibrate([one for one in series if one.person == "p-001"])
    save_mapper(mapper, folder / "mind_meld.safetensors")
    return folder / "mind_meld.safetensors"


def _weights(folder: Path) -> Path:
    save_model(load_shipped_model(), folder / "weights.safetensors")
    return folder / "weights.safetensors"


def _taught(folder: Path) -> Path:
    config = TeachConfig(
        learners=("bc",),
        teachers=1,
        rounds=1,
        task="easy",
        learner_seeds=1,
        starts=1,
        starts_on_the_way=1,
        training_steps=2,
        seed=101,
    )
    teach(config, folder / "run", command="steerlab teach", progress=_silent)
    return folder / "run"


def _shard(folder: Path) -> Path:
    return next((folder / "teachers").glob("*.json"))


def _policy(folder: Path) -> Path:
    return next((_taught(folder) / "policies").rglob("*.safetensors"))


def _condition_table(folder: Path) -> Path:
    rows = ["participant,condition,round,success,final_distance_m,label_mae,position"]
    rows += [f"P{p},{c},0,{p / 4},{p}.5,,{i}" for p in range(4) for i, c in enumerate("ab")]
    path = folder / "conditions.csv"
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")
    return path


def _power(folder: Path) -> Path:
    design = PowerDesign(people=(8,), studies=BLOCK)
    power_run.power(design, folder / "power", command="steerlab power", progress=_silent)
    return next((folder / "power" / power_run.BLOCKS).glob("*.json"))


def _population(folder: Path) -> Path:
    config = PopulationRunConfig(teachers=3, new_teachers=2, rollouts=4, ladder="quick", seed=3)
    lab = presets.LAB
    presets.PRESETS["lab"] = replace(
        lab, training=replace(lab.training, epochs=1, least_per_epoch=1)
    )
    try:
        simulate(config, folder / "run", force=False, command="x", progress=_silent)
    finally:
        presets.PRESETS["lab"] = lab
    return folder / "run"


def _profile(folder: Path) -> Path:
    path = folder / "wheel.toml"
    path.write_text(profile_to_toml(shipped_profiles()[0].profile), encoding="utf-8")
    return path


def _questionnaire(folder: Path) -> Path:
    from importlib.resources import files

    text = files("steerlab.assets").joinpath("questionnaires", "fluency.toml").read_bytes()
    (folder / "ours.toml").write_bytes(text.replace(b'"fluency"', b'"ours"'))
    return folder / "ours.toml"


def _protocol(folder: Path) -> Path:
    from tests.study.conftest import make_small

    return make_small(folder / "study") / "study.toml"


def _read_protocol(path: Path) -> object:
    return parse_protocol(utf8_text(path), str(path), study_questionnaires(path.parent))


def _trace(folder: Path) -> Path:
    rows = ["step,wheel,throttle,brake,buttons", "0,0.1,0,0,", "1,-2.5,1,0.5,redo", "2,,,,"]
    (folder / "trace.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    return folder / "trace.csv"


def _study(folder: Path) -> Path:
    from tests.study.conftest import _run_scripted, make_small

    study = make_small(folder / "study")
    with Study.open(study) as opened:
        for seed, role in ((1, Role.TRAINING), (2, Role.TRAINING)):
            _run_scripted(opened, role, seed)
    return study


def _read_everything(folder: Path) -> object:
    with Study.open(folder, read_only=True) as study:
        for person in study.participants():
            study.findings(person.id)
        study.verify()
        study.notes(None)
    return read_study(folder, networks=1, progress=_silent)


def _export(folder: Path) -> Path:
    """A study with an export in it, and a packed one beside."""
    study, config = _study(folder), ExportConfig(formats=("csv", "parquet"))
    export(study, config, None, force=False, progress=_silent)
    (study / "packed.zip").write_bytes(packed(study, default_out(study, config))[1])
    return study


def _exports_of(folder: Path) -> object:
    """What an erasure and ``verify`` look for, and what the next export takes as it is."""
    export(folder, ExportConfig(formats=("csv", "parquet")), None, force=False, progress=_silent)
    return left_of(folder, "T001"), derived_files(folder, ())


READERS = (
    Reader(name="labels, csv", write=_label_csv, read=_read_labels, damage=bytes_of, share=4),
    Reader(
        name="labels, parquet",
        write=_label_parquet,
        read=_read_labels,
        damage=damage_parquet,
        share=4,
    ),
    Reader(
        name="shards",
        write=_labels,
        read=read_shards,
        damage=damage_parquet,
        damaged=lambda folder: next(folder.iterdir()),
    ),
    Reader(name="rollouts", write=_rollout_file, read=read_rollouts, damage=damage_parquet),
    Reader(name="mapper", write=_mapper, read=load_mapper, damage=tensors_of),
    Reader(name="policy", write=_policy, read=load_policy, damage=tensors_of),
    Reader(name="pretrained weights", write=_weights, read=load_model, damage=tensors_of),
    Reader(
        name="teach shard",
        write=lambda folder: _shard(_taught(folder)),
        read=read_shard,
        damage=json_of,
        share=8,
    ),
    Reader(
        name="teach run",
        write=_taught,
        read=lambda folder: (read_conditions(folder), left_out_teachers(folder)),
        damage=json_of,
        damaged=_shard,
        share=4,
    ),
    Reader(
        name="conditions, csv",
        write=_condition_table,
        read=read_conditions,
        damage=bytes_of,
        share=8,
    ),
    Reader(name="power block", write=_power, read=power_run._read, damage=json_of, share=16),
    Reader(
        name="population run",
        write=_population,
        read=lambda folder: read_population(folder, networks=1, progress=_silent),
        damage=json_of,
        damaged=lambda folder: folder / "summary.json",
        share=0.2,
    ),
    Reader(
        name="wheel profile",
        write=_profile,
        read=lambda path: profile_from_toml(utf8_text(path), str(path)),
        damage=bytes_of,
        share=16,
    ),
    Reader(
        name="questionnaire",
        write=_questionnaire,
        read=lambda path: questionnaire_from_toml(utf8_text(path), str(path)),
        damage=bytes_of,
        share=16,
    ),
    Reader(name="protocol", write=_protocol, read=_read_protocol, damage=bytes_of, share=4),
    Reader(name="trace", write=_trace, read=read_trace, damage=bytes_of, share=16),
    Reader(
        name="export's summary",
        write=_export,
        read=_exports_of,
        damage=json_of,
        damaged=lambda folder: folder / "exports" / "csv+parquet" / "summary.json",
        share=0.1,
    ),
    Reader(
        name="packed export",
        write=_export,
        read=lambda folder: left_of(folder, "T001"),
        damage=bytes_of,
        damaged=lambda folder: folder / "packed.zip",
        share=0.5,
    ),
    Reader(
        name="study",
        write=_study,
        read=_read_everything,
        damage=database_of,
        damaged=lambda folder: folder / "study.db",
        share=0.1,
    ),
)


def copied(source: Path, target: Path) -> Path:
    """A copy of a reader's file or folder in ``target``, which is emptied."""
    shutil.rmtree(target, ignore_errors=True)
    target.mkdir(parents=True)
    if source.is_dir():
        return Path(shutil.copytree(source, target / source.name))
    return Path(shutil.copy(source, target / source.name))
