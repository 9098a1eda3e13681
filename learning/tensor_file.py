"""safetensors files whose header carries our JSON; those who write and read them know what it means."""

import json
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

import torch
from safetensors import safe_open
from safetensors.torch import save
from torch import Tensor, nn

from steerlab.learning.errors import InvalidCheckpoint
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.files.reading import reading

Network = TypeVar("Network", bound=nn.Module)


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


@contextmanager
def in_header(path: Path) -> Iterator[None]:
    """Settings that are read from a file's header in this block are named with the file.

    Raises:
        InvalidCheckpoint: one is not what it may be.
    """
    try:
        yield
    except InvalidConfig as error:
        raise InvalidCheckpoint(f"{path} holds settings that are none: {error}") from error


def network_of(tensors: Mapping[str, Tensor], make: Callable[[], Network]) -> Network:
    """A network with ``tensors`` as its parameters; it gets memory only once its sizes are theirs.

    Args:
        make: builds it from what the file's header says.

    Raises:
        ValueError: the header's sizes are not those of the tensors.
        RuntimeError: they are beyond any machine.
    """
    with torch.device("meta"):
        network = make()
    wanted = {name: tuple(value.shape) for name, value in network.state_dict().items()}
    found = {name: tuple(value.shape) for name, value in tensors.items()}
    for name in sorted({*wanted, *found}):
        if found.get(name) != wanted.get(name):
            raise ValueError(
                f"{name} is {found.get(name, 'missing')}, its header says "
                f"{wanted.get(name, 'nothing of it')}"
            )
    network.to_empty(device="cpu").load_state_dict(tensors)
    return network


def without_prefix(tensors: dict[str, Tensor], prefix: str) -> dict[str, Tensor]:
    """The tensors whose names begin with ``prefix``, by the rest of their names."""
    return {
        name.removeprefix(prefix): value
        for name, value in tensors.items()
        if name.startswith(prefix)
    }
