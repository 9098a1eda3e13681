"""What a study freezes: versions of its protocol, the network, and each test participant's w."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from steerlab.sim.arrays import FloatArray
from steerlab.study.store.connection import StoreConnection
from steerlab.study.store.rows import Table
from steerlab.study.store.seals import seal


@dataclass(frozen=True, kw_only=True, slots=True)
class FrozenProtocol:
    """One version of the protocol as its file was; ``sha256`` is of ``text``."""

    version: int
    frozen_utc: str
    sha256: str
    text: str
    why: str


@dataclass(frozen=True, kw_only=True, slots=True)
class Instrument:
    """A questionnaire as it was when the protocol was frozen."""

    key: str
    version: int
    sha256: str


@dataclass(frozen=True, kw_only=True, slots=True)
class FrozenModel:
    """A trained network that test participants are calibrated with.

    Attributes:
        file: within the study's folder.
        people: the participants whose labels it was trained on.
        inputs: hash of those labels.
        removed_utc: None while it is in use.
    """

    id: int
    at_utc: str
    file: str
    sha256: str
    people: tuple[str, ...]
    inputs: str
    removed_utc: str | None


@dataclass(frozen=True, kw_only=True, eq=False)
class StoredEmbedding:
    """A test participant's w, and how certain it is.

    Attributes:
        w: (d,).
        covariance: (d, d).
        distance, outside: as in ``learning.certainty.Calibrated``.
        inputs: hash of the labels it comes from.
    """

    participant: str
    model_sha256: str
    w: FloatArray
    covariance: FloatArray
    distance: float | None
    outside: bool
    inputs: str


PROTOCOLS = Table("protocols", FrozenProtocol)
INSTRUMENTS = Table("instruments", Instrument)
MODELS = Table("models", FrozenModel)
EMBEDDINGS = Table("embeddings", StoredEmbedding)


def insert_protocol(
    connection: StoreConnection,
    *,
    sha256: str,
    text: str,
    why: str,
    instruments: Sequence[Instrument],
) -> int:
    """Freeze the next version.

    Returns:
        its number, from 1.
    """
    (last,) = connection.run("SELECT coalesce(max(version), 0) FROM protocols").fetchone()
    version, at_utc = last + 1, connection.now()
    frozen = FrozenProtocol(version=version, frozen_utc=at_utc, sha256=sha256, text=text, why=why)
    PROTOCOLS.insert(connection, frozen)
    for instrument in instruments:
        INSTRUMENTS.insert(connection, instrument, protocol_version=version)
    connection.log("protocol frozen", f"version {version}, sha256 {sha256}: {why}")
    return version


def read_protocols(connection: StoreConnection) -> list[FrozenProtocol]:
    """All versions, oldest first."""
    return PROTOCOLS.select(connection, "ORDER BY version")


def read_instruments(connection: StoreConnection, version: int) -> Mapping[str, Instrument]:
    """The questionnaires of a version of the protocol, by key."""
    rows = INSTRUMENTS.select(connection, "WHERE protocol_version = ?", version)
    return {instrument.key: instrument for instrument in rows}


def insert_model(
    connection: StoreConnection, *, file: str, sha256: str, people: Sequence[str], inputs: str
) -> None:
    """Freeze a network."""
    model = FrozenModel(
        id=connection.next_id("models"),
        at_utc=connection.now(),
        file=file,
        sha256=sha256,
        people=tuple(people),
        inputs=inputs,
        removed_utc=None,
    )
    MODELS.insert(connection, model)
    connection.log("network frozen", f"{file}, sha256 {sha256}, of {', '.join(people)}")
    seal(connection, "network", model.id)


def mark_model_removed(connection: StoreConnection, model: FrozenModel, why: str) -> None:
    """Keep that a network is no longer in use."""
    update = "UPDATE models SET removed_utc = ? WHERE id = ?"
    connection.run(update, connection.now(), model.id)
    connection.log("network removed", f"{model.file}: {why}")


def read_models(connection: StoreConnection) -> list[FrozenModel]:
    """All networks, oldest first."""
    return MODELS.select(connection, "ORDER BY id")


def people_in_use(connection: StoreConnection) -> set[str]:
    """The participants whose labels the network in use was trained on."""
    models = read_models(connection)
    return {person for model in models if model.removed_utc is None for person in model.people}


def insert_embedding(connection: StoreConnection, embedding: StoredEmbedding) -> None:
    """Keep a participant's w; the newest counts, and older ones stay."""
    id_ = connection.next_id("embeddings")
    EMBEDDINGS.insert(connection, embedding, id=id_, at_utc=connection.now())
    connection.log("w kept", f"{embedding.participant} with network {embedding.model_sha256}")
    seal(connection, "w", id_)


def read_embeddings(connection: StoreConnection) -> dict[str, StoredEmbedding]:
    """The newest w of everyone who has one."""
    rows = EMBEDDINGS.select(connection, "ORDER BY id")
    return {embedding.participant: embedding for embedding in rows}
