"""Model files: safetensors, with the configuration as JSON in the header. Never pickle."""

import json
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file
from torch import Tensor

from steerlab.learning.errors import InvalidCheckpoint
from steerlab.learning.mapper import MindMeldMapper
from steerlab.learning.mind_meld import MindMeld
from steerlab.learning.presets import MapperConfig
from steerlab.sim.errors import InvalidConfig

FORMAT = "steerlab.mind_meld"
FORMAT_VERSION = 1
_NETWORK = "network."


def save_mapper(mapper: MindMeldMapper, path: Path) -> None:
    """Write a fitted mapper and everyone's embedding.

    Raises:
        NotFitted: the mapper is not trained.
    """
    people = list(mapper.people)
    tensors = {_NETWORK + name: value for name, value in mapper.network.state_dict().items()}
    tensors["mean_embedding"] = mapper.mean_embedding
    tensors["embeddings"] = torch.stack([mapper.embedding_tensor(person) for person in people])
    header = {
        "format": FORMAT,
        "version": FORMAT_VERSION,
        "seed": mapper.seed,
        "config": mapper.config.to_dict(),
        "people": people,
    }
    contiguous = {name: value.contiguous() for name, value in tensors.items()}
    save_file(contiguous, path, metadata={"steerlab": json.dumps(header, sort_keys=True)})


def load_mapper(path: Path) -> MindMeldMapper:
    """Read what ``save_mapper`` wrote, bit for bit.

    Raises:
        InvalidCheckpoint: the file is missing, damaged, of another kind or a newer version.
    """
    tensors, header = _read(path)
    if header.get("format") != FORMAT:
        raise InvalidCheckpoint(
            f"{path} holds {header.get('format')!r}, not {FORMAT!r}; give a MIND MELD model."
        )
    if header.get("version") != FORMAT_VERSION:
        raise InvalidCheckpoint(
            f"{path} has format version {header.get('version')!r}; this steerlab reads "
            f"{FORMAT_VERSION}. Fit the mapper again or use the steerlab that wrote it."
        )
    try:
        config = MapperConfig.from_dict(header["config"])
        people, seed = [str(person) for person in header["people"]], int(header["seed"])
        network = MindMeld(config.network, torch.Generator().manual_seed(0))
        network.load_state_dict(
            {
                name.removeprefix(_NETWORK): value
                for name, value in tensors.items()
                if name.startswith(_NETWORK)
            }
        )
        mean_embedding, embeddings = tensors["mean_embedding"], tensors["embeddings"]
    except (InvalidConfig, KeyError, TypeError, ValueError, RuntimeError) as error:
        raise InvalidCheckpoint(f"{path} does not fit its own header: {error}") from error
    size = config.network.embedding_size
    if embeddings.shape != (len(people), size) or mean_embedding.shape != (size,):
        raise InvalidCheckpoint(
            f"{path} has embeddings {tuple(embeddings.shape)} for {len(people)} people "
            f"of size {size}; the file is damaged."
        )
    by_person = dict(zip(people, embeddings, strict=True))
    return MindMeldMapper.from_trained(config, seed, network, mean_embedding, by_person)


def _read(path: Path) -> tuple[dict[str, Tensor], dict[str, Any]]:
    if not path.is_file():
        raise InvalidCheckpoint(f"No model file at {path}; fit a mapper first.")
    try:
        with safe_open(path, framework="pt") as file:
            metadata = file.metadata() or {}
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    except (SafetensorError, OSError) as error:
        raise InvalidCheckpoint(f"{path} is not a safetensors file: {error}") from error
    try:
        header = json.loads(metadata["steerlab"])
    except (KeyError, json.JSONDecodeError) as error:
        raise InvalidCheckpoint(f"{path} has no steerlab header; give a steerlab model.") from error
    if not isinstance(header, dict):
        raise InvalidCheckpoint(f"{path} has a steerlab header that is not a JSON object.")
    return tensors, header
