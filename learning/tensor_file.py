"""Reads safetensors files whose header carries our JSON; their readers know what it means."""

import json
from pathlib import Path
from typing import Any

from safetensors import SafetensorError, safe_open
from torch import Tensor

from steerlab.learning.errors import InvalidCheckpoint


def read_tensors(path: Path, *, what: str, remedy: str) -> tuple[dict[str, Tensor], dict[str, Any]]:
    """Tensors by name, and the JSON object under ``steerlab`` in the header.

    Args:
        what: the kind of file, for messages.
        remedy: what the user can do about a missing or foreign file.

    Raises:
        InvalidCheckpoint: the file is missing, damaged, or has no such header.
    """
    if not path.is_file():
        raise InvalidCheckpoint(f"No {what} file at {path}; {remedy}.")
    try:
        with safe_open(path, framework="pt") as file:
            metadata = file.metadata() or {}
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    except (SafetensorError, OSError) as error:
        raise InvalidCheckpoint(f"{path} is not a safetensors file: {error}") from error
    try:
        header = json.loads(metadata["steerlab"])
    except (KeyError, json.JSONDecodeError) as error:
        raise InvalidCheckpoint(f"{path} has no steerlab header; {remedy}.") from error
    if not isinstance(header, dict):
        raise InvalidCheckpoint(f"{path} has a steerlab header that is not a JSON object.")
    return tensors, header


def without_prefix(tensors: dict[str, Tensor], prefix: str) -> dict[str, Tensor]:
    """The tensors whose names begin with ``prefix``, by the rest of their names."""
    return {
        name.removeprefix(prefix): value
        for name, value in tensors.items()
        if name.startswith(prefix)
    }
