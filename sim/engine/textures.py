"""Pictures that scenery is covered with, made of noise; each tile continues into the next."""

import numpy as np
from numpy.typing import NDArray

Picture = NDArray[np.uint8]
"""(height, width, 3) RGB."""

Rgb = tuple[float, float, float]
"""Each in [0, 1]."""

SLABS = 2  # on each side of the asphalt's tile


def asphalt(rng: np.random.Generator, px: int = 256) -> Picture:
    """Slabs of asphalt with joints between them: what passes tells how fast one goes."""
    shade = 0.012 * _noise(rng, px, 0.3) + 0.022 * _noise(rng, px, 1.6)
    slab_px = px // SLABS
    slabs = rng.uniform(-0.028, 0.028, (SLABS, SLABS))
    shade += np.kron(slabs, np.ones((slab_px, slab_px)))
    place = np.arange(px) % slab_px
    joint = np.minimum(place, slab_px - place) < max(1, px // 300)
    shade[joint, :] -= 0.085
    shade[:, joint] -= 0.085
    return _tinted(shade, (0.47, 0.475, 0.48))


def grass(rng: np.random.Generator, px: int = 128) -> Picture:
    """Grass in patches."""
    patches = _noise(rng, px, 1.7)[..., None] * np.array((0.055, 0.045, 0.02))
    return _tinted(0.03 * _noise(rng, px, 0.4), (0.40, 0.50, 0.28), patches)


def kerb(px: int = 32) -> Picture:
    """A red and a white part."""
    stripes = np.full((px, px, 3), 235, np.uint8)
    stripes[:, : px // 2] = (190, 45, 40)
    return stripes


def crate(rng: np.random.Generator, px: int = 64) -> Picture:
    """(6 * px, px, 3): the faces of a box, pale, so that its own colour shows; darker at the edges."""
    place = (np.arange(px) + 0.5) / px
    edge = np.minimum.outer(np.minimum(place, 1 - place), np.minimum(place, 1 - place))
    shade = np.where(edge < 0.035, -0.32, np.where(edge < 0.05, 0.06, 0.0))
    inside = edge >= 0.05
    shade = shade + inside * 0.05 * np.sign(np.sin(2 * np.pi * 9 * place))[None, :]
    shade = shade + 0.02 * _noise(rng, px, 1.2)
    return np.tile(_tinted(shade, (0.9, 0.9, 0.9)), (6, 1, 1))


def _noise(rng: np.random.Generator, px: int, smooth: float) -> NDArray[np.float64]:
    """(px, px) of mean 0 and deviation 1; its spectrum falls as frequency ** -smooth."""
    waves = np.hypot(np.fft.fftfreq(px)[:, None], np.fft.fftfreq(px)[None, :]) * px
    waves[0, 0] = np.inf
    noise = np.fft.ifft2(np.fft.fft2(rng.standard_normal((px, px))) * waves**-smooth).real
    return noise / noise.std()


def _tinted(
    shade: NDArray[np.float64], rgb: Rgb, more: NDArray[np.float64] | float = 0.0
) -> Picture:
    return np.round(255 * np.clip(shade[..., None] + rgb + more, 0.0, 1.0)).astype(np.uint8)
