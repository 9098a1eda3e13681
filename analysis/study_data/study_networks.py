"""The networks of a study's analysis: the frozen one, and those that are judged on held-out rollouts."""

from collections.abc import Sequence
from dataclasses import replace

from steerlab.analysis.study_data.networks import Progress, embeddings_of, judge, network_for
from steerlab.analysis.study_data.records import Embeddings, HeldOut, Person
from steerlab.learning.series import LabelSeries
from steerlab.learning.splits import split_rollouts, split_study
from steerlab.sim.errors import SteerlabError
from steerlab.study.frozen_files import MODELS
from steerlab.study.models import frozen_model, load_frozen
from steerlab.study.opened import OpenStudy

_FEWEST_ROLLOUTS = 3  # of which one is held out
_FEWEST_PEOPLE = 3


def study_networks(
    study: OpenStudy,
    people: Sequence[Person],
    series: Sequence[LabelSeries],
    networks: int,
    progress: Progress,
    notices: list[str],
) -> tuple[list[Embeddings], list[HeldOut]]:
    """The frozen network's w, then those of ``networks`` that hold rollouts out, with their errors.

    Args:
        notices: grows by what the report should say.
    """
    training = [one.id for one in people if one.role == "training"]
    frozen = _frozen(study, training, notices)
    embeddings = [] if frozen is None else [frozen]
    held_out: list[HeldOut] = []
    protocol = study.current()
    # Earlier versions of a protocol may have had other rollouts; what was labelled is judged.
    present = {one.rollout for one in series}
    rollouts = [name for name in protocol.rollouts if name in present]
    rollouts += sorted(present - set(rollouts))
    if not networks:
        return embeddings, held_out
    if why := _untrainable(training, rollouts):
        notices.append(f"No network was trained for the analysis: {why}.")
        return embeddings, held_out
    from steerlab.learning.presets import preset

    config = preset(protocol.mapper.preset)
    if protocol.mapper.epochs is not None:
        config = replace(config, training=replace(config.training, epochs=protocol.mapper.epochs))
    for seed in range(protocol.seed, protocol.seed + networks):
        try:
            new = [one.id for one in people if one.role == "test"]
            parts = split_study(series, split_rollouts(rollouts), new)
            cache = study.folder / MODELS
            mapper = network_for(parts, config, seed=seed, cache=cache, progress=progress)
            source = f"trained for the analysis with seed {seed}, without the held-out rollouts"
            found = embeddings_of(mapper, training, seed=seed, source=source)
            judged = (
                judge(mapper, parts.held_out_seen, seed=seed, role="training"),
                judge(mapper, parts.held_out_new, seed=seed, role="test"),
            )
        except SteerlabError as error:  # the rest of the report does not need this network
            notices.append(f"No network could be trained and judged with seed {seed}: {error}")
            break
        embeddings += [] if found is None else [found]
        held_out += [one for one in judged if one is not None]
    return embeddings, held_out


def _frozen(study: OpenStudy, training: Sequence[str], notices: list[str]) -> Embeddings | None:
    """The training participants' w in the frozen network."""
    model = frozen_model(study)
    if model is None:
        notices.append(
            "No network is frozen: w can only be that of networks trained for this analysis."
        )
        return None
    try:
        mapper = load_frozen(study, model)
    except SteerlabError as error:
        notices.append(f"The frozen network cannot be used: {error}")
        return None
    found = embeddings_of(mapper, training, seed=mapper.seed, source="the frozen network")
    known = () if found is None else found.people
    if strangers := [one for one in training if one not in known]:
        notices.append(
            f"{', '.join(strangers)} finished after the network was frozen, so they have no w from "
            f"it."
        )
    return found


def _untrainable(training: Sequence[str], rollouts: Sequence[str]) -> str:
    if len(training) < _FEWEST_PEOPLE:
        return f"training participants who finished: {len(training)}; {_FEWEST_PEOPLE} are needed"
    if len(rollouts) < _FEWEST_ROLLOUTS:
        return f"rollouts: {len(rollouts)}; {_FEWEST_ROLLOUTS} are needed to hold one out"
    return ""
