"""What erasing one participant's data touches beyond their own, to be said before it is done."""

from dataclasses import dataclass

from steerlab.study.models import frozen_model, training_people
from steerlab.study.progress import everybody
from steerlab.study.store.frozen import read_embeddings
from steerlab.study.store.teaching import read_taught
from steerlab.study.study_folder import OpenStudy


@dataclass(frozen=True, kw_only=True, slots=True)
class Reach:
    """What is removed, and who depends on it.

    Attributes:
        network: the file of the network in use, if it has learnt from the participant; else empty,
            and the rest is empty as well.
        embeddings: test participants whose w comes from it, and is found anew.
        taught: those of them who have taught robots with it, which stays as it happened.
        left: how many training participants a new network could learn from.
        needed: how many it needs.
    """

    network: str = ""
    embeddings: tuple[str, ...] = ()
    taught: tuple[str, ...] = ()
    left: int = 0
    needed: int = 0


def erasing_reaches(study: OpenStudy, participant: str) -> Reach:
    """What erasing the participant's data touches of others'; nothing is changed."""
    with study.reading():
        model = frozen_model(study)
        if model is None or participant not in model.people:
            return Reach()
        connection = study.store.connection
        kept = read_embeddings(connection)
        depend = [who for who, one in sorted(kept.items()) if one.model_sha256 == model.sha256]
        phases = {one.view.id: one.view.phases for one in everybody(study)}
        return Reach(
            network=model.file,
            embeddings=tuple(depend),
            taught=tuple(
                who
                for who in depend
                if any(
                    taught.mapper_sha256 is not None
                    for phase, _ in phases[who]
                    for taught in read_taught(connection, who, phase.id)
                )
            ),
            left=sum(person.view.id != participant for person in training_people(study)),
            needed=study.current().mapper.minimum_people,
        )
