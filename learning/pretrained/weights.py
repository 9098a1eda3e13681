"""Weights files: safetensors, with sizes and origin as JSON in the header. Never pickle."""

from dataclasses import asdict
from importlib.resources import as_file, files
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from steerlab.learning.empirical_bayes.gaussian import Prior
from steerlab.learning.errors import InvalidCheckpoint
from steerlab.learning.pretrained.model import PretrainedModel, ResidualConfig, ResidualNetwork
from steerlab.learning.pretrained.style import (
    COMPONENTS,
    FORWARD_FEATURES,
    INVERSE_FEATURES,
    STYLE_SIZE,
    StyleEncoder,
)
from steerlab.learning.pretrained.teachers import STYLE
from steerlab.learning.tensor_file import (
    in_header,
    network_of,
    read_tensors,
    without_prefix,
    write_tensors,
)
from steerlab.sim.arrays import FloatArray
from steerlab.sim.files.reading import reading

FORMAT = "steerlab.sim_pretrained"
FORMAT_VERSION = 2
WEIGHTS_FILE = "sim_pretrained.safetensors"
_NETWORK = "network."
_REMAKE = "make it again with python -m steerlab.learning.pretrained.train"
_SCALARS = ("noise", "noise_rows", "temper")


def save_model(model: PretrainedModel, path: Path) -> None:
    """Write a pre-trained model."""
    encoder = model.encoder
    arrays: dict[str, FloatArray] = {
        "inverse_mean": encoder.inverse.mean,
        "inverse_covariance": encoder.inverse.covariance,
        "forward_mean": encoder.forward.mean,
        "forward_covariance": encoder.forward.covariance,
        "inverse_axes": encoder.inverse_axes,
        "forward_axes": encoder.forward_axes,
        "offset": encoder.offset,
        "scale": encoder.scale,
        "style_readout": model.style_readout,
    }
    tensors = {name: torch.from_numpy(value).contiguous() for name, value in arrays.items()}
    tensors |= {
        _NETWORK + name: value.contiguous() for name, value in model.network.state_dict().items()
    }
    header = {
        "format": FORMAT,
        "version": FORMAT_VERSION,
        "seed": model.seed,
        "network": asdict(model.network.config),
        "inverse": {name: getattr(encoder.inverse, name) for name in _SCALARS},
        "forward": {name: getattr(encoder.forward, name) for name in _SCALARS},
    }
    write_tensors(tensors, header, path)


def load_model(path: Path) -> PretrainedModel:
    """Read what ``save_model`` wrote, bit for bit.

    Raises:
        InvalidCheckpoint: the file is missing, damaged, of another kind or another version.
    """
    tensors, header = read_tensors(path, what="weights", remedy=_REMAKE)
    if header.get("format") != FORMAT or header.get("version") != FORMAT_VERSION:
        raise InvalidCheckpoint(
            f"{path} holds {header.get('format')!r} version {header.get('version')!r}, not "
            f"{FORMAT!r} version {FORMAT_VERSION}; {_REMAKE}."
        )
    with reading(path, "weights", InvalidCheckpoint, f"Is it damaged? If so, {_REMAKE}."):
        arrays = {name: _array(tensors, name, shape, path) for name, shape in _shapes().items()}
        with in_header(path):
            config = ResidualConfig(**header["network"])
        network = network_of(
            without_prefix(tensors, _NETWORK), lambda: ResidualNetwork(config, torch.Generator())
        )
        priors = {
            side: Prior(
                mean=arrays[f"{side}_mean"],
                covariance=arrays[f"{side}_covariance"],
                **{name: float(header[side][name]) for name in _SCALARS},
            )
            for side in ("inverse", "forward")
        }
        seed = int(header["seed"])
    encoder = StyleEncoder(
        inverse=priors["inverse"],
        forward=priors["forward"],
        inverse_axes=arrays["inverse_axes"],
        forward_axes=arrays["forward_axes"],
        offset=arrays["offset"],
        scale=arrays["scale"],
    )
    return PretrainedModel(
        encoder=encoder,
        network=network.requires_grad_(False),
        style_readout=arrays["style_readout"],
        seed=seed,
    )


def load_shipped_model() -> PretrainedModel:
    """The weights that ship with the package."""
    with as_file(files("steerlab.assets") / WEIGHTS_FILE) as path:
        return load_model(path)


def _shapes() -> dict[str, tuple[int, ...]]:
    return {
        "inverse_mean": (INVERSE_FEATURES,),
        "inverse_covariance": (INVERSE_FEATURES, INVERSE_FEATURES),
        "forward_mean": (FORWARD_FEATURES,),
        "forward_covariance": (FORWARD_FEATURES, FORWARD_FEATURES),
        "inverse_axes": (INVERSE_FEATURES, COMPONENTS),
        "forward_axes": (FORWARD_FEATURES, COMPONENTS),
        "offset": (STYLE_SIZE,),
        "scale": (STYLE_SIZE,),
        "style_readout": (1 + STYLE_SIZE, len(STYLE)),
    }


def _array(tensors: dict[str, Tensor], name: str, shape: tuple[int, ...], path: Path) -> FloatArray:
    value = np.asarray(tensors[name].numpy(), dtype=np.float64)
    if value.shape != shape or not np.isfinite(value).all():
        raise InvalidCheckpoint(
            f"{path}: {name} is {value.shape}, not {shape} and finite; {_REMAKE}."
        )
    return value
