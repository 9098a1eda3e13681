"""The learners' policy: a small network from camera image and motion to a wheel position.

The state is the paper's: image, velocity and acceleration in the car's own frame. Neither pose (it
memorises one world) nor the wheel itself (it confuses causes) is an input.
"""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Literal, get_args

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from steerlab.learning.errors import InvalidCheckpoint, InvalidLabels
from steerlab.learning.tensor_file import in_header, network_of, read_tensors, write_tensors
from steerlab.learning.training import torch_threads
from steerlab.sim.arrays import FloatArray
from steerlab.sim.errors import InvalidConfig
from steerlab.sim.files.reading import reading
from steerlab.sim.vehicle import WHEEL_LIMIT

Frames = NDArray[np.uint8]
Inputs = Literal["image+state", "image", "state"]
IMAGE_SHAPE = (3, 16, 32)
MOTION_SIZE = 5
CAMERA_PX = 64
_ROWS = slice(16, 48)  # the horizon lies in between; above is sky, below the bonnet's ground
MOTION_CENTRE = (5.0, 0.0, 0.0, 0.0, 0.0)  # m/s, m/s, rad/s, m/s², m/s²
MOTION_SCALE = (1.0, 0.3, 0.5, 1.0, 2.0)
FORMAT, FORMAT_VERSION = "steerlab-policy", 1


@dataclass(frozen=True, slots=True, eq=False)
class Observations:
    """What a policy may see: images and motion, a row each.

    Attributes:
        image: (rows, 3, 16, 32) uint8, RGB.
        motion: (rows, 5) float32: forward and leftward m/s, yaw rad/s, forward and leftward m/s².
    """

    image: Frames
    motion: NDArray[np.float32]

    def __post_init__(self) -> None:
        rows = len(self.image)
        if self.image.shape != (rows, *IMAGE_SHAPE) or self.motion.shape != (rows, MOTION_SIZE):
            raise InvalidLabels(
                f"image {self.image.shape} and motion {self.motion.shape} are not "
                f"(rows, {', '.join(map(str, IMAGE_SHAPE))}) and (rows, {MOTION_SIZE})."
            )

    def __len__(self) -> int:
        return len(self.image)

    def take(self, rows: NDArray[np.bool_] | NDArray[np.int64]) -> "Observations":
        """The chosen rows."""
        return Observations(self.image[rows], self.motion[rows])


def stack(observations: list[Observations]) -> Observations:
    """All rows of all ``observations``, in order."""
    return Observations(
        np.concatenate([seen.image for seen in observations]),
        np.concatenate([seen.motion for seen in observations]),
    )


def pool_frame(frame: Frames) -> Frames:
    """(64, 64, 3) camera frame -> (3, 16, 32): the middle rows, each 2 x 2 pixels averaged."""
    middle = frame[_ROWS].astype(np.uint16)
    pooled = (
        middle[0::2, 0::2] + middle[0::2, 1::2] + middle[1::2, 0::2] + middle[1::2, 1::2]
    ) // 4
    return np.ascontiguousarray(pooled.transpose(2, 0, 1).astype(np.uint8))


@dataclass(frozen=True, kw_only=True)
class PolicyConfig:
    """Size of the network, and what it may see; the others are ablations.

    Attributes:
        channels: of the three convolutions.
        hidden: units of the layer between the features and the wheel.
    """

    inputs: Inputs = "image+state"
    channels: tuple[int, int, int] = (16, 32, 32)
    hidden: int = 64

    def __post_init__(self) -> None:
        if self.inputs not in get_args(Inputs):
            raise InvalidConfig(
                f"inputs is {self.inputs!r}; choose one of {', '.join(get_args(Inputs))}."
            )
        sizes = (*self.channels, self.hidden)
        if len(sizes) != 4 or min(sizes) < 1:
            raise InvalidConfig(
                f"channels {self.channels} and hidden {self.hidden}: give three and one, all "
                "positive."
            )


class PolicyNetwork(nn.Module):
    """Three strided convolutions, then the motion beside the image's features, then the wheel."""

    def __init__(self, config: PolicyConfig, generator: torch.Generator) -> None:
        super().__init__()
        self.config = config
        first, second, third = config.channels
        self.image = nn.Sequential(
            nn.Conv2d(3, first, 5, stride=2, padding=2),
            nn.ReLU(),
            nn.Conv2d(first, second, 3, stride=2, padding=1),
            nn.ReLU(),
            nn.Conv2d(second, third, 3, stride=2, padding=1),
            nn.ReLU(),
            nn.Flatten(),
        )
        size = (third * 8 if config.inputs != "state" else 0) + (
            MOTION_SIZE if config.inputs != "image" else 0
        )
        self.hidden = nn.Linear(size, config.hidden)
        self.wheel = nn.Linear(config.hidden, 1)
        for module in self.modules():
            if isinstance(module, nn.Conv2d | nn.Linear):
                nn.init.kaiming_uniform_(module.weight, nonlinearity="relu", generator=generator)
                if module.bias is not None:
                    nn.init.zeros_(module.bias)
        with torch.no_grad():
            self.wheel.weight.mul_(0.1)  # begins near straight on

    def features(self, image: Tensor, motion: Tensor) -> Tensor:
        """(rows, 3, 16, 32) uint8 and (rows, 5) -> (rows, hidden)."""
        inputs: list[Tensor] = []
        if self.config.inputs != "state":
            inputs.append(self.image(image.float().mul_(1.0 / 127.5).sub_(1.0)))
        if self.config.inputs != "image":
            centre, scale = torch.tensor(MOTION_CENTRE), torch.tensor(MOTION_SCALE)
            inputs.append((motion - centre) / scale)
        return torch.relu(self.hidden(torch.cat(inputs, dim=1)))

    def forward(self, image: Tensor, motion: Tensor) -> Tensor:
        """(rows,) wheel positions, not clipped."""
        return self.wheel(self.features(image, motion)).squeeze(1)


def decide(network: PolicyNetwork, seen: Observations) -> FloatArray:
    """Wheel positions (rows,) within ±``WHEEL_LIMIT``."""
    with torch.inference_mode(), torch_threads(1):
        wheel = network(torch.from_numpy(seen.image), torch.from_numpy(seen.motion))
    return np.clip(wheel.numpy().astype(np.float64), -WHEEL_LIMIT, WHEEL_LIMIT)


def hidden_features(network: PolicyNetwork, seen: Observations) -> FloatArray:
    """The last hidden layer, (rows, hidden)."""
    with torch.inference_mode(), torch_threads(1):
        hidden = network.features(torch.from_numpy(seen.image), torch.from_numpy(seen.motion))
    return hidden.numpy().astype(np.float64)


def save_policy(network: PolicyNetwork, path: Path) -> None:
    """Write weights and configuration as safetensors."""
    header = {"format": FORMAT, "version": FORMAT_VERSION, "config": asdict(network.config)}
    tensors = {name: value.contiguous() for name, value in network.state_dict().items()}
    write_tensors(tensors, header, path)


def load_policy(path: Path) -> PolicyNetwork:
    """Read what ``save_policy`` wrote, bit for bit.

    Raises:
        InvalidCheckpoint: the file is missing, damaged, or of another kind or version.
    """
    tensors, header = read_tensors(path, what="policy", remedy="teach one and save it")
    if (header.get("format"), header.get("version")) != (FORMAT, FORMAT_VERSION):
        raise InvalidCheckpoint(
            f"{path} holds {header.get('format')!r} version {header.get('version')!r}, not "
            f"{FORMAT!r} version {FORMAT_VERSION}; give a policy."
        )
    with reading(path, "a policy", InvalidCheckpoint, "Teach one and save it."):
        fields = dict(header["config"])
        fields["channels"] = tuple(fields["channels"])
        with in_header(path):
            config = PolicyConfig(**fields)
        return network_of(tensors, lambda: PolicyNetwork(config, torch.Generator()))
