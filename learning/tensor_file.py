"""safetensors files whose header carries our JSON; those who write and read them know what it means."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from safetensors import safe_open
from safetensors.torch import save
from torch import Tensor

from steerlab.learning.errors import InvalidCheckpoint
from steerlab.sim.files.reading import reading


def write_tensors(tensors: Mapping[str, Tensor], header: Mapping[str, Any], path: Path) -> None:
    """Write tensors, and the JSON object under ``steerlab`` in the header.

    Raises:
        InvalidCheckpoint: a number is NaN or infinite: nobody could use the file.
        OSError: the disk does not take it.
    """
    try:
        text = json.dumps(header, allow_nan=False)
        check_finite(tensors)
    except ValueError as error:
        raise InvalidCheckpoint(
            f"{path.name} was not written: {error}. Training has diverged, or learned from numbers "
            "of absurd size."
        ) from error
    contiguous = {name: value.contiguous() for name, value in tensors.items()}
    path.write_bytes(save(contiguous, metadata={"steerlab": text}))


def read_tensors(path: Path, *, what: str, remedy: str) -> tuple[dict[str, Tensor], dict[str, Any]]:
    """Tensors by name, all finite, and the JSON object under ``steerlab`` in the header.

    Args:
        what: the kind of file, for messages.
        remedy: what the user can do about a missing or foreign file.

    Raises:
        InvalidCheckpoint: the file is missing, damaged, has no such header, or a number in it is
            NaN or infinite.
    """
    if not path.is_file():
        raise InvalidCheckpoint(f"No {what} file at {path}; {remedy}.")
    with reading(path, f"a {what} file", InvalidCheckpoint, f"Is it damaged? If so, {remedy}."):
        with safe_open(path, framework="pt") as file:
            metadata = file.metadata() or {}
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
        if "steerlab" not in metadata:
            raise InvalidCheckpoint(f"{path} has no steerlab header; {remedy}.")
        header = json.loads(metadata["steerlab"])
        if not isinstance(header, dict):
            raise InvalidCheckpoint(f"{path} has a steerlab header that is not a JSON object.")
        check_finite(tensors)
    return tensors, header


def check_finite(tensors: Mapping[str, Tensor]) -> None:
    """Refuse NaN and infinity.

    Raises:
        ValueError: there is one.
    """
    for name, tensor in tensors.items():
        if not bool(torch.isfinite(tensor).all()):
            raise ValueError(f"{name} holds NaN or infinity")


def without_prefix(tensors: dict[str, Tensor], prefix: str) -> dict[str, Tensor]:
    """The tensors whose names begin with ``prefix``, by the rest of their names."""
    return {
        name.removeprefix(prefix): value
        for name, value in tensors.items()
        if name.startswith(prefix)
    }
