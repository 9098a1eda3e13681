"""Model files: safetensors, with the configuration as JSON in the header. Never pickle."""

from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from steerlab.learning.certainty import Calibrated
from steerlab.learning.errors import InvalidCheckpoint
from steerlab.learning.mapper import MindMeldMapper
from steerlab.learning.mind_meld import MindMeld
from steerlab.learning.presets import MapperConfig
from steerlab.learning.tensor_file import (
    in_header,
    network_of,
    read_tensors,
    without_prefix,
    write_tensors,
)
from steerlab.sim.arrays import FloatArray
from steerlab.sim.files.reading import reading

FORMAT = "steerlab.mind_meld"
FORMAT_VERSION = 2  # 1 knew no certainty of embeddings
_NETWORK = "network."


def save_mapper(mapper: MindMeldMapper, path: Path) -> None:
    """Write a fitted mapper and everyone's embedding.

    Raises:
        NotFitted: the mapper is not trained.
    """
    people = list(mapper.people)
    tensors = {_NETWORK + name: value for name, value in mapper.network.state_dict().items()}
    tensors["training_embeddings"] = mapper.training_embeddings
    tensors["embeddings"] = torch.stack([mapper.embedding_tensor(person) for person in people])
    calibrated = [mapper.calibration(person) for person in mapper.calibrated]
    size = mapper.config.network.embedding_size
    tensors["covariances"] = _stack(
        [calibration.covariance for calibration in calibrated], (size, size)
    )
    tensors["g_sigmas"] = _stack([calibration.g_sigma for calibration in calibrated], (size,))
    header = {
        "format": FORMAT,
        "version": FORMAT_VERSION,
        "seed": mapper.seed,
        "config": mapper.config.to_dict(),
        "people": people,
        "calibrated": {
            person: {"distance": calibration.distance, "outside": calibration.outside}
            for person, calibration in zip(mapper.calibrated, calibrated, strict=True)
        },
    }
    write_tensors(tensors, header, path)


def load_mapper(path: Path) -> MindMeldMapper:
    """Read what ``save_mapper`` wrote, bit for bit.

    Raises:
        InvalidCheckpoint: the file is missing, damaged, of another kind or a newer version.
    """
    tensors, header = read_tensors(path, what="model", remedy="fit a mapper and save it")
    if header.get("format") != FORMAT:
        raise InvalidCheckpoint(
            f"{path} holds {header.get('format')!r}, not {FORMAT!r}; give a MIND MELD model."
        )
    if header.get("version") != FORMAT_VERSION:
        raise InvalidCheckpoint(
            f"{path} has format version {header.get('version')!r}; this steerlab reads "
            f"{FORMAT_VERSION}. Fit the mapper again or use the steerlab that wrote it."
        )
    with reading(path, "a MIND MELD model", InvalidCheckpoint, "Fit the mapper again."):
        with in_header(path):
            config = MapperConfig.from_dict(header["config"])
        people, seed = [str(person) for person in header["people"]], int(header["seed"])
        network = network_of(
            without_prefix(tensors, _NETWORK), lambda: MindMeld(config.network, torch.Generator())
        )
        training, embeddings = tensors["training_embeddings"], tensors["embeddings"]
        size = config.network.embedding_size
        if embeddings.shape != (len(people), size) or training.shape[1:] != (size,):
            raise InvalidCheckpoint(
                f"{path} has embeddings {tuple(embeddings.shape)} for {len(people)} people "
                f"of size {size}; the file is damaged."
            )
        by_person = dict(zip(people, embeddings, strict=True))
        calibrated = {
            person: Calibrated(
                embedding=by_person[person].double().numpy(),
                covariance=covariance.numpy(),
                g_sigma=g_sigma.numpy(),
                distance=None if kept["distance"] is None else float(kept["distance"]),
                outside=bool(kept["outside"]),
            )
            for (person, kept), covariance, g_sigma in zip(
                header["calibrated"].items(),
                tensors["covariances"],
                tensors["g_sigmas"],
                strict=True,
            )
        }
    return MindMeldMapper.from_trained(config, seed, network, training, by_person, calibrated)


def _stack(arrays: list[FloatArray], shape: tuple[int, ...]) -> Tensor:
    """(people, *shape) float64; people may be 0."""
    return torch.from_numpy(np.array(arrays, dtype=np.float64).reshape(-1, *shape))
