"""Who teaches, and the mappers that know them: trained on other people, frozen, then calibrated."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from steerlab.app.teach_config import TeachConfig
from steerlab.learning.baselines import BASELINES, CEILING, fit_baselines
from steerlab.learning.checkpoint import load_mapper, save_mapper
from steerlab.learning.mapper import LabelMapper, MindMeldMapper
from steerlab.learning.presets import LAB
from steerlab.learning.series import LabelSeries, series_from_table
from steerlab.learning.splits import StudySplit
from steerlab.sim.calibration_set import load_calibration_set
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.files.run_folder import keeping
from steerlab.sim.populations import sample_population
from steerlab.sim.progress import Progress
from steerlab.sim.records import labelled_table
from steerlab.sim.rollout import Rollout
from steerlab.sim.scripted_teacher import ScriptedTeacher, TeacherStyle
from steerlab.sim.unusual_teachers import OutOfFamilyKind, UnusualTeacher, sample_out_of_family
from steerlab.sim.wide_population import sample_wide
from steerlab.teleop.loop import label_rollout

Person = ScriptedTeacher | UnusualTeacher


@dataclass(frozen=True, kw_only=True, eq=False)
class Prepared:
    """Test teachers, and every mapper the learners need, calibrated on them."""

    teachers: list[Person]
    mappers: dict[str, LabelMapper]


def sample_teachers(config: TeachConfig) -> list[Person]:
    """The people who teach; those before do not change when their number grows."""
    if config.family == "scripted" or config.population == "wide":
        return [*_sample(config, config.teachers, prefix="test")]
    if config.family == "sparse":
        return [*sample_population("sparse", config.teachers, config.seed, prefix="test-sparse")]
    family: OutOfFamilyKind = config.family
    return [
        *sample_out_of_family(
            family, config.population, config.teachers, config.seed, prefix=f"test-{family}"
        )
    ]


def prepare(
    config: TeachConfig,
    models: Path,
    progress: Progress,
    *,
    given: MindMeldMapper | None = None,
) -> Prepared:
    """Train the mappers on other people's calibration labels and calibrate the test teachers.

    MIND MELD's network is kept in ``models`` and read from there when a run is continued.

    Args:
        given: a MIND MELD network to use instead.

    Raises:
        InvalidCheckpoint: the kept file is damaged.
    """
    teachers = sample_teachers(config)
    if not config.baselines:
        return Prepared(teachers=teachers, mappers={})
    rollouts = load_calibration_set()
    others = _sample(config, config.training_teachers, prefix="seen")
    seen, new = _label(rollouts, others), _label(rollouts, teachers)
    mind_meld = given or _mind_meld(config, seen, models / "mind_meld.safetensors", progress)
    mind_meld.calibrate(new)
    parts = StudySplit(
        train_seen=tuple(seen), held_out_seen=(), calibrate_new=tuple(new), held_out_new=()
    )
    styles = None
    if CEILING in config.baselines:
        styles = {one.name: _style_of(one) for one in (*others, *teachers)}
    ladder = fit_baselines(
        mind_meld,
        parts,
        seed=config.seed,
        on_step=lambda share: progress("fitting other mappers", share),
        without={*BASELINES, CEILING} - config.baselines,
        styles=styles,
    )
    return Prepared(teachers=teachers, mappers={name: ladder[name] for name in config.baselines})


def given_mapper(path: Path) -> MindMeldMapper:
    """The MIND MELD network in a file.

    Raises:
        InvalidConfig: it was trained on another window.
        InvalidCheckpoint: there is no such file, or it is damaged.
    """
    mapper = load_mapper(path)
    check_window(mapper, path)
    return mapper


def check_window(mapper: MindMeldMapper, path: Path) -> None:
    """Refuse a mapper that was trained to read labels otherwise than they are given here.

    Raises:
        InvalidConfig: its window, or the rate it reads labels at, is another.
    """
    found, wanted = mapper.config.window, LAB.window
    if found != wanted:
        raise InvalidConfig(
            f"{path} was trained on a window of {found}; whole drives are mapped here with "
            f"{wanted}. Give a mapper of `steerlab simulate` or `fit`, or leave --mapper out."
        )


def _sample(config: TeachConfig, count: int, *, prefix: str) -> list[ScriptedTeacher]:
    if config.population == "wide":
        return sample_wide(count, config.seed, prefix=prefix)
    return sample_population(config.population, count, config.seed, prefix=prefix)


def _mind_meld(
    config: TeachConfig,
    seen: Sequence[LabelSeries],
    kept: Path,
    progress: Progress,
) -> MindMeldMapper:
    if kept.is_file():
        return given_mapper(kept)
    mapper = MindMeldMapper(
        LAB,
        seed=config.seed,
        on_epoch=lambda done, of: progress("training MIND MELD", done / of),
    )
    mapper.fit(seen)
    with keeping(kept) as fresh:
        save_mapper(mapper, fresh)
    return given_mapper(kept)  # as when the run goes on; and it can be sent to other processes


def _label(rollouts: Sequence[Rollout], people: Sequence[Person]) -> list[LabelSeries]:
    return [
        series
        for person in people
        for order, rollout in enumerate(rollouts)
        for series in series_from_table(
            labelled_table(
                rollout, label_rollout(rollout, person, order=order), participant=person.name
            )
        )
    ]


def _style_of(person: Person) -> TeacherStyle:
    return person.scripted.style if isinstance(person, UnusualTeacher) else person.style
