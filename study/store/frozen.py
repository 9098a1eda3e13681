"""What a study freezes: versions of its protocol, the network, and each test participant's w."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from steerlab.sim.rollout import FloatArray
from steerlab.study.store.connection import StoreConnection
from steerlab.study.store.people import NOW


@dataclass(frozen=True, kw_only=True, slots=True)
class FrozenProtocol:
    """One version of the protocol, word for word; ``sha256`` is of ``text``."""

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
        people: whose labels it was trained on.
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
    """A test participant's w, and how sure it is.

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
    version = last + 1
    connection.run(f"INSERT INTO protocols VALUES (?, {NOW}, ?, ?, ?)", version, sha256, text, why)
    for one in instruments:
        values = (version, one.key, one.version, one.sha256)
        connection.run("INSERT INTO instruments VALUES (?, ?, ?, ?)", *values)
    connection.log("protocol frozen", f"version {version}, sha256 {sha256}: {why}")
    return version


def read_protocols(connection: StoreConnection) -> list[FrozenProtocol]:
    """All versions, oldest first."""
    rows = connection.read(
        "SELECT version, frozen_utc, sha256, text, why FROM protocols ORDER BY version"
    )
    return [
        FrozenProtocol(version=version, frozen_utc=at_utc, sha256=sha256, text=text, why=why)
        for version, at_utc, sha256, text, why in rows
    ]


def read_instruments(connection: StoreConnection, version: int) -> Mapping[str, Instrument]:
    """The questionnaires of a version of the protocol, by key."""
    rows = connection.read(
        "SELECT key, version, sha256 FROM instruments WHERE protocol_version = ?", version
    )
    return {key: Instrument(key=key, version=number, sha256=hash_) for key, number, hash_ in rows}


def insert_model(
    connection: StoreConnection, *, file: str, sha256: str, people: Sequence[str], inputs: str
) -> None:
    """Freeze a network."""
    connection.run(
        f"INSERT INTO models (at_utc, file, sha256, people, inputs) VALUES ({NOW}, ?, ?, ?, ?)",
        *(file, sha256, json.dumps(list(people)), inputs),
    )
    connection.log("network frozen", f"{file}, sha256 {sha256}, of {', '.join(people)}")


def mark_model_removed(connection: StoreConnection, model: FrozenModel, why: str) -> None:
    """Keep that a network is no longer in use."""
    connection.run(f"UPDATE models SET removed_utc = {NOW} WHERE id = ?", model.id)
    connection.log("network removed", f"{model.file}: {why}")


def read_models(connection: StoreConnection) -> list[FrozenModel]:
    """All, oldest first."""
    rows = connection.read(
        "SELECT id, at_utc, file, sha256, people, inputs, removed_utc FROM models ORDER BY id"
    )
    return [
        FrozenModel(
            id=id_,
            at_utc=at_utc,
            file=file,
            sha256=sha256,
            people=tuple(json.loads(people)),
            inputs=inputs,
            removed_utc=removed_utc,
        )
        for id_, at_utc, file, sha256, people, inputs, removed_utc in rows
    ]


def insert_embedding(connection: StoreConnection, found: StoredEmbedding) -> None:
    """Keep a participant's w; a later one takes its place and both stay."""
    connection.run(
        "INSERT INTO embeddings (participant, at_utc, model_sha256, w, covariance, distance, "
        f"outside, inputs) VALUES (?, {NOW}, ?, ?, ?, ?, ?, ?)",
        *(found.participant, found.model_sha256),
        *(json.dumps(found.w.tolist()), json.dumps(found.covariance.tolist())),
        *(found.distance, int(found.outside), found.inputs),
    )
    connection.log("w kept", f"{found.participant} with network {found.model_sha256}")


def read_embeddings(connection: StoreConnection) -> dict[str, StoredEmbedding]:
    """The newest w of everyone who has one."""
    rows = connection.read(
        "SELECT participant, model_sha256, w, covariance, distance, outside, inputs "
        "FROM embeddings ORDER BY id"
    )
    return {
        participant: StoredEmbedding(
            participant=participant,
            model_sha256=model,
            w=np.array(json.loads(w), dtype=np.float64),
            covariance=np.array(json.loads(covariance), dtype=np.float64),
            distance=distance,
            outside=bool(outside),
            inputs=inputs,
        )
        for participant, model, w, covariance, distance, outside, inputs in rows
    }
