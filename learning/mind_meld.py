"""The three networks of MIND MELD (paper, section Architecture)."""

from dataclasses import dataclass
from math import sqrt

import torch
from torch import Tensor, nn

from steerlab.learning.windows import CHANNELS
from steerlab.sim.errors import InvalidConfig

LOG_SIGMA_RANGE = (-5.0, 2.0)  # keeps exp(log sigma) finite early in training


@dataclass(frozen=True, kw_only=True)
class NetworkConfig:
    """Sizes; the paper gives the LSTM's 32, f's 200 and g's 64 and 32."""

    embedding_size: int = 4  # d; the paper draws 2
    lstm_size: int = 32
    encoding_size: int = 16  # k
    difference_hidden: int = 200
    inference_hidden: tuple[int, int] = (64, 32)

    def __post_init__(self) -> None:
        object.__setattr__(self, "inference_hidden", tuple(self.inference_hidden))  # from JSON
        sizes = (self.embedding_size, self.lstm_size, self.encoding_size, self.difference_hidden)
        if min(*sizes, *self.inference_hidden) < 1 or len(self.inference_hidden) != 2:
            raise InvalidConfig(f"{self} has a size below 1 or not two inference layers.")


class WindowEncoder(nn.Module):
    """E: windows -> z. A bidirectional LSTM read at the window's centre, then a linear layer.

    Read at the centre, the forward LSTM needs only the first half of the window and the backward
    one only the second: the same numbers as a full pass for about half the work.
    """

    def __init__(self, config: NetworkConfig) -> None:
        super().__init__()
        self.forward_lstm = nn.LSTM(CHANNELS, config.lstm_size)
        self.backward_lstm = nn.LSTM(CHANNELS, config.lstm_size)
        self.to_encoding = nn.Linear(2 * config.lstm_size, config.encoding_size)

    def forward(self, inputs: Tensor) -> Tensor:
        """inputs: (batch, window, channels) -> z: (batch, k)."""
        samples, centre = inputs.transpose(0, 1), inputs.shape[1] // 2
        past, future = samples[: centre + 1], samples[centre:].flip(0)
        if self._is_trained_here(samples):
            from steerlab.learning.half_lstm import last_hidden  # numba is needed for no more

            hidden = last_hidden((self.forward_lstm, self.backward_lstm), past, future)
        else:
            _, (of_past, _) = self.forward_lstm(past)
            _, (of_future, _) = self.backward_lstm(future)
            hidden = torch.cat([of_past[0], of_future[0]], dim=1)
        return self.to_encoding(hidden)

    def _is_trained_here(self, samples: Tensor) -> bool:
        """Whether the compiled way serves: in training on a processor."""
        weight = self.forward_lstm.weight_hh_l0
        wanted = torch.is_grad_enabled() and weight.requires_grad and not samples.requires_grad
        of_tiles = weight.device.type == "cpu" and self.forward_lstm.hidden_size % 4 == 0
        return bool(wanted and of_tiles and weight.dtype == samples.dtype == torch.float32)

    def bidirectional(self) -> nn.LSTM:
        """An ordinary bidirectional LSTM with these weights; for checks and benchmarks."""
        size = self.forward_lstm.hidden_size
        both = nn.LSTM(CHANNELS, size, batch_first=True, bidirectional=True)
        reverse = self.backward_lstm.state_dict()
        weights = {f"{name}_reverse": value for name, value in reverse.items()}
        both.load_state_dict({**self.forward_lstm.state_dict(), **weights})
        return both


class DifferenceNetwork(nn.Module):
    """f: z, w -> d, the predicted difference ``a - o``; one hidden layer."""

    def __init__(self, config: NetworkConfig) -> None:
        super().__init__()
        self.hidden = nn.Linear(
            config.encoding_size + config.embedding_size, config.difference_hidden
        )
        self.out = nn.Linear(config.difference_hidden, 1)

    def forward(self, encoding: Tensor, embedding: Tensor) -> Tensor:
        """encoding: (batch, k), embedding: (batch, d) -> difference: (batch,)."""
        hidden = torch.relu(self.hidden(torch.cat([encoding, embedding], dim=1)))
        return self.out(hidden).squeeze(1)


class InferenceNetwork(nn.Module):
    """g: z, d -> the approximate posterior N(mu, sigma²) over w; two hidden layers."""

    def __init__(self, config: NetworkConfig) -> None:
        super().__init__()
        first, second = config.inference_hidden
        self.layers = nn.Sequential(
            nn.Linear(config.encoding_size + 1, first),
            nn.ReLU(),
            nn.Linear(first, second),
            nn.ReLU(),
            nn.Linear(second, 2 * config.embedding_size),
        )

    def forward(self, encoding: Tensor, difference: Tensor) -> tuple[Tensor, Tensor]:
        """encoding: (batch, k), difference: (batch,) -> mu, log sigma: (batch, d) each."""
        mean, log_sigma = self.layers(torch.cat([encoding, difference[:, None]], dim=1)).chunk(2, 1)
        return mean, log_sigma.clamp(*LOG_SIGMA_RANGE)


class MindMeld(nn.Module):
    """Encoder, f and g together; the embeddings live outside, one per person.

    Args:
        config: sizes.
        generator: draws the initial weights; torch's global generator is neither read nor moved.
    """

    def __init__(self, config: NetworkConfig, generator: torch.Generator) -> None:
        super().__init__()
        with torch.random.fork_rng(devices=[]):
            self.encoder = WindowEncoder(config)
            self.difference = DifferenceNetwork(config)
            self.inference = InferenceNetwork(config)
        with torch.no_grad():  # torch's default scheme, from our generator
            for module in self.modules():
                if isinstance(module, nn.LSTM):
                    bound = 1.0 / sqrt(module.hidden_size)
                elif isinstance(module, nn.Linear):
                    bound = 1.0 / sqrt(module.in_features)
                else:
                    continue
                for parameter in module.parameters():
                    parameter.uniform_(-bound, bound, generator=generator)
