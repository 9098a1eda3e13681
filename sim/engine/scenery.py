"""What makes the drawn world worth looking at: asphalt, grass, hills, trees, landmarks and a hood.

It is added to the scenes that people look at (``WorldView``), never to one that is simulated or that
a policy's camera sees. Nothing in it touches anything, and all of it but the pole over the ball is
drawn by the blocks alone: the same wherever the ball lies, so that no landmark shows the way.
"""

from hashlib import sha256
from math import cos, pi, sin
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from steerlab.sim.engine.car import HOOD_GROUP
from steerlab.sim.engine.textures import SLABS, Picture, asphalt, crate, grass, kerb
from steerlab.sim.vehicle import CarConfig
from steerlab.sim.world import BALL_RADIUS_M, WorldSpec

SLAB_M = 5.0
KERB_M = 0.6
POLE_M = 9.0
PAINT = (0.46, 0.07, 0.09, 1.0)  # darker than the car is: much of it is seen
_TREES, _SIDES = 110, 6
_GREENS = ((0.16, 0.30, 0.17), (0.21, 0.36, 0.18), (0.27, 0.40, 0.20))
_HILLS = ((0.47, 0.56, 0.60), (0.36, 0.47, 0.42))  # far ones and nearer ones
_BLOCK_PAINTS = (
    (0.27, 0.42, 0.66, 1.0),
    (0.50, 0.36, 0.62, 1.0),
    (0.22, 0.53, 0.55, 1.0),
    (0.62, 0.42, 0.33, 1.0),
)
_BOX, _ROUND, _BALL = (
    mujoco.mjtGeom.mjGEOM_BOX,
    mujoco.mjtGeom.mjGEOM_CYLINDER,
    mujoco.mjtGeom.mjGEOM_ELLIPSOID,
)
_WHITE, _RED, _STEEL = (0.93, 0.93, 0.91, 1.0), (0.75, 0.20, 0.17, 1.0), (0.55, 0.58, 0.60, 1.0)
# Shape, half sizes, height of the middle above the ground, colour.
_LANDMARKS = (
    (  # water tower
        (_ROUND, (1.1, 8.0, 0.0), 8.0, _STEEL),
        (_BALL, (5.0, 5.0, 3.2), 18.0, _WHITE),
        (_ROUND, (5.05, 0.5, 0.0), 18.0, _RED),
    ),
    tuple(  # mast
        (_ROUND, (0.5, 2.5, 0.0), 2.5 + 5.0 * part, _RED if part % 2 == 0 else _WHITE)
        for part in range(7)
    ),
    (  # hall
        (_BOX, (14.0, 8.0, 4.0), 4.0, (0.75, 0.74, 0.70, 1.0)),
        (_BOX, (14.4, 8.4, 0.4), 8.4, (0.35, 0.38, 0.42, 1.0)),
        (_BOX, (3.0, 8.1, 2.4), 2.4, (0.25, 0.42, 0.62, 1.0)),
    ),
    (  # barn
        (_BOX, (7.0, 5.0, 3.0), 3.0, (0.60, 0.20, 0.16, 1.0)),
        (_BOX, (7.4, 3.6, 0.9), 6.6, (0.33, 0.22, 0.19, 1.0)),
    ),
    (  # silos
        (_ROUND, (3.2, 7.0, 0.0), 7.0, (0.80, 0.80, 0.76, 1.0)),
        (_BALL, (3.2, 3.2, 2.0), 14.0, (0.50, 0.53, 0.56, 1.0)),
    ),
)


def scenery_rng(world: WorldSpec) -> np.random.Generator:
    """Drawn by the ground and its blocks, and by nothing that says where the ball or the start is."""
    ground = repr((world.half_extent_m, world.blocks)).encode()
    return np.random.default_rng(int.from_bytes(sha256(ground).digest()[:8], "big"))


def add_scenery(spec: mujoco.MjSpec, world: WorldSpec, car: CarConfig) -> None:
    """Cover a composed scene, which must be for looking at only."""
    rng = scenery_rng(world)
    _ground(spec, world.half_extent_m, rng)
    _blocks(spec, len(world.blocks), rng)
    for number, (radius_m, height_m) in enumerate(((190.0, 22.0), (165.0, 11.0))):
        hills = _hills(rng, world.half_extent_m / 50.0 * radius_m, height_m)
        _mesh(spec, spec.worldbody, f"hills_{number}", *hills, (*_HILLS[number], 1.0))
    for number, green in enumerate(_GREENS):
        trees = _trees(rng, world.half_extent_m, _TREES // len(_GREENS))
        _mesh(spec, spec.worldbody, f"trees_{number}", *trees, (*green, 1.0))
    _landmarks(spec, world.half_extent_m, rng)
    _pole(spec, *world.ball_xy_m)
    _hood(spec, car)


def _ground(spec: mujoco.MjSpec, half_m: float, rng: np.random.Generator) -> None:
    """Asphalt as far as the line, then a kerb, then grass; no two of them one over the other."""
    line_m, far_m = half_m + 0.15, 4.0 * half_m
    pad: Any = spec.geom("ground")
    pad.size = (line_m, line_m, line_m)
    pad.material = _cover(spec, "asphalt", asphalt(rng), 2 * line_m / (SLABS * SLAB_M))
    _cover(spec, "kerb", kerb(), (2 * line_m + 2 * KERB_M) / 3.0, across=1.0)
    _cover(spec, "grass", grass(rng), 2 * far_m / 24.0)
    kerb_m, reach_m = line_m + KERB_M / 2, line_m + KERB_M
    grass_m = (far_m + reach_m) / 2
    for number in range(4):
        quat = (cos(number * pi / 4), 0.0, 0.0, sin(number * pi / 4))
        out = (cos(number * pi / 2), sin(number * pi / 2))
        for name, at_m, along_m, across_m in (
            ("kerb", kerb_m, reach_m if number % 2 else line_m, KERB_M / 2),
            ("grass", grass_m, far_m if number % 2 else reach_m, far_m - grass_m),
        ):
            _geom(
                spec.worldbody,
                type=mujoco.mjtGeom.mjGEOM_PLANE,
                name=f"{name}_{number}",
                pos=(-at_m * out[1], at_m * out[0], 0.0),
                quat=quat,
                size=(along_m, across_m, along_m),
                material=name,
            )


def _blocks(spec: mujoco.MjSpec, count: int, rng: np.random.Generator) -> None:
    material = _cover(spec, "crate", crate(rng), 1.0, cube=True)
    for number in range(count):
        box: Any = spec.geom(f"block_{number}/box")
        box.material = material
        box.rgba = _BLOCK_PAINTS[number % len(_BLOCK_PAINTS)]


def _landmarks(spec: mujoco.MjSpec, half_m: float, rng: np.random.Generator) -> None:
    """One of each kind, all around the ground: which is where, the blocks draw."""
    turn = rng.uniform(0.0, 2 * pi)
    for number, kind in enumerate(rng.permutation(len(_LANDMARKS))):
        bearing = turn + 2 * pi * (number + rng.uniform(-0.25, 0.25)) / len(_LANDMARKS)
        distance_m = half_m + rng.uniform(22.0, 40.0)
        scale = distance_m / max(abs(cos(bearing)), abs(sin(bearing)))
        angle = rng.uniform(0.0, pi) / 2
        body = spec.worldbody.add_body(
            name=f"landmark_{number}",
            pos=(scale * cos(bearing), scale * sin(bearing), 0.0),
            quat=(cos(angle), 0.0, 0.0, sin(angle)),
        )
        for part, (shape, size, z_m, rgba) in enumerate(_LANDMARKS[kind]):
            _geom(
                body,
                name=f"landmark_{number}_{part}",
                type=shape,
                size=size,
                pos=(0.0, 0.0, z_m),
                rgba=rgba,
            )


def _pole(spec: mujoco.MjSpec, x_m: float, y_m: float) -> None:
    """Over the ball, which one may see from everywhere, as the arrow and the metres say where it is."""
    for name, radius_m, low_m, high_m in (
        ("pole", 0.12, 2 * BALL_RADIUS_M, POLE_M),
        ("flag", 0.55, POLE_M, POLE_M + 1.1),
    ):
        _geom(
            spec.worldbody,
            name=name,
            type=mujoco.mjtGeom.mjGEOM_CYLINDER,
            size=(radius_m, (high_m - low_m) / 2, 0.0),
            pos=(x_m, y_m, (low_m + high_m) / 2),
            rgba=(1.0, 0.45, 0.05, 1.0),
        )


def _hood(spec: mujoco.MjSpec, car: CarConfig) -> None:
    """From the windscreen to the bumper: what is ahead of its edge is ahead of the car."""
    rows, columns = np.linspace(0.0, 1.0, 10), np.linspace(-1.0, 1.0, 21)
    along, across = np.meshgrid(rows, columns, indexing="ij")
    front_m, half_m = car.length_m / 2, car.width_m / 2
    x_m = 0.55 + (front_m - 0.55) * along * (1.0 - 0.06 * across**4)
    y_m = half_m * across * (1.0 - 0.10 * along**3)
    ridges = 0.025 * np.exp(-(((np.abs(across) - 0.62) / 0.10) ** 2)) * (1.0 - 0.7 * along)
    z_m = 0.90 - 0.09 * along**2 - 0.14 * along**8 - 0.05 * across**2 - 0.10 * across**8 + ridges
    corner = np.arange(len(rows) * len(columns)).reshape(along.shape)
    a, b, c, d = corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]
    faces = np.stack((a, b, c, a, c, d), axis=-1).reshape(-1, 3)
    points = np.stack((x_m, y_m, z_m), axis=-1).reshape(-1, 3)
    chassis: Any = spec.body("car/chassis")
    _mesh(spec, chassis, "hood", points, faces, PAINT, group=HOOD_GROUP, shine=0.6)


def _hills(
    rng: np.random.Generator, radius_m: float, height_m: float
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """A ring of slopes around everything, up to ``height_m`` high."""
    count, waves = 120, np.arange(2, 14)
    angle = 2 * pi * np.arange(count) / count
    phase, strength = rng.uniform(0, 2 * pi, len(waves)), rng.normal(size=len(waves)) / waves**0.7
    line = (strength * np.cos(np.outer(angle, waves) + phase)).sum(axis=1)
    tops = height_m * (0.25 + 0.75 * (line - line.min()) / np.ptp(line))
    ring = np.stack((radius_m * np.cos(angle), radius_m * np.sin(angle)), axis=-1)
    points = np.concatenate((np.c_[0.9 * ring, np.full(count, -0.5)], np.c_[ring, tops]), axis=0)
    here, there = np.arange(count), (np.arange(count) + 1) % count
    faces = np.concatenate(
        (np.c_[here, here + count, there], np.c_[there, here + count, there + count])
    )
    return points, faces


def _trees(
    rng: np.random.Generator, half_m: float, count: int
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Firs beyond the line, two cones each, in one mesh: one thing to draw."""
    around = 2 * pi * np.arange(_SIDES) / _SIDES
    points: list[NDArray[np.float64]] = []
    faces: list[NDArray[np.int64]] = []
    here = np.arange(_SIDES)
    for _ in range(count):
        bearing, size_m = rng.uniform(0.0, 2 * pi), rng.uniform(4.0, 9.0)
        distance_m = half_m + 8.0 + 60.0 * rng.beta(1.2, 1.6)
        scale = distance_m / max(abs(cos(bearing)), abs(sin(bearing)))
        middle = scale * np.array((cos(bearing), sin(bearing)))
        for low, high, wide in ((0.05, 0.68, 0.27), (0.40, 1.0, 0.19)):
            first = _SIDES * len(points) + len(points)
            ring = middle + wide * size_m * np.c_[np.cos(around), np.sin(around)]
            points.append(
                np.r_[np.c_[ring, np.full(_SIDES, low * size_m)], [[*middle, high * size_m]]]
            )
            faces.append(first + np.c_[here, (here + 1) % _SIDES, np.full(_SIDES, _SIDES)])
    return np.concatenate(points), np.concatenate(faces)


def _cover(
    spec: mujoco.MjSpec,
    name: str,
    picture: Picture,
    repeat: float,
    *,
    across: float | None = None,
    cube: bool = False,
) -> str:
    """Name of a material that repeats ``picture`` so often along each side."""
    texture: Any = spec.add_texture(
        name=name,
        type=mujoco.mjtTexture.mjTEXTURE_CUBE if cube else mujoco.mjtTexture.mjTEXTURE_2D,
        width=picture.shape[1],
        height=picture.shape[0],
        nchannel=3,
    )
    texture.data = picture.tobytes()
    material: Any = spec.add_material(name=name, specular=0.0, shininess=0.0, reflectance=0.0)
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = name
    material.texrepeat = (repeat, repeat if across is None else across)
    return name


def _mesh(
    spec: mujoco.MjSpec,
    body: Any,
    name: str,
    points: NDArray[np.float64],
    faces: NDArray[np.int64],
    rgba: tuple[float, float, float, float],
    *,
    group: int = 0,
    shine: float = 0.0,
) -> None:
    mesh: Any = spec.add_mesh(
        name=name, uservert=points.ravel().tolist(), userface=faces.ravel().tolist()
    )
    mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL  # a surface without an inside
    spec.add_material(name=name, specular=shine, shininess=shine, rgba=rgba)
    _geom(
        body,
        name=name,
        type=mujoco.mjtGeom.mjGEOM_MESH,
        meshname=name,
        material=name,
        group=group,
    )


def _geom(body: Any, **what: Any) -> None:
    """Only drawn: it touches nothing and weighs nothing."""
    body.add_geom(contype=0, conaffinity=0, mass=0.0, **what)
