"""Participants' links: unguessable, one at a time, and kept only as hashes."""

import secrets
from hashlib import sha256

from steerlab.study.contract import StudyError
from steerlab.study.opened import OpenStudy
from steerlab.study.progress import progress_of
from steerlab.study.store.people import insert_link, read_link_owner


def new_link(study: OpenStudy, participant: str) -> str:
    """A fresh token; older ones of the participant end.

    Raises:
        StudyError: there is no such participant, or they have withdrawn.
    """
    standing = progress_of(study, participant).view.standing
    if standing.withdrawn:
        raise StudyError(f"{participant} has left ({standing}).")
    token = secrets.token_urlsafe(32)
    with study.store.connection.transaction(f"make a link for {participant!r}", durable=True):
        insert_link(study.store.connection, participant, _hash(token))
    return token


def participant_of(study: OpenStudy, token: str) -> str | None:
    """Whose newest token it is; None if nobody's.

    Whoever has withdrawn may still open their page: it thanks them and says what became of their
    data. So the hash of their newest token stays, also when everything else is erased.
    """
    return read_link_owner(study.store.connection, _hash(token))


def _hash(token: str) -> str:
    return sha256(token.encode("utf-8", "surrogatepass")).hexdigest()
