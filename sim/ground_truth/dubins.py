"""Dubins curves: the shortest way between two poses for a car that only drives forward.

The six words in closed form, after Shkel & Lumelsky, "Classification of the Dubins set",
Robotics and Autonomous Systems 34 (2001). Angles are in radians, lengths in turning radii unless
the name says metres.
"""

from math import acos, atan2, cos, pi, sin, sqrt

import numpy as np
from numba import njit

WORDS = ("LSL", "RSR", "LSR", "RSL", "RLR", "LRL")
_TURNS = np.array(
    ((1, 0, 1), (-1, 0, -1), (1, 0, -1), (-1, 0, 1), (-1, 1, -1), (1, -1, 1)), dtype=np.float64
)  # per word: +1 left, 0 straight, -1 right
_NEARLY_FULL_TURN = 2.0 * pi - 1e-9


@njit(cache=True)
def turn_angle(angle_rad: float) -> float:
    """An angle in [0, 2 pi); what rounding makes a full turn becomes none."""
    wrapped = angle_rad % (2.0 * pi)
    return 0.0 if wrapped > _NEARLY_FULL_TURN else wrapped


@njit(cache=True)
def dubins_word(
    word: int, distance: float, alpha: float, beta: float
) -> tuple[float, float, float]:
    """The three segment lengths of one word, in radii; the first is infinite where none exists.

    Args:
        word: index into ``WORDS``.
        distance: between the poses, in radii.
        alpha: first heading relative to the line between the poses.
        beta: last heading relative to that line.
    """
    sa, sb, ca, cb = sin(alpha), sin(beta), cos(alpha), cos(beta)
    cab = cos(alpha - beta)
    none = (np.inf, 0.0, 0.0)
    if word == 0:
        squared = 2.0 + distance * distance - 2.0 * cab + 2.0 * distance * (sa - sb)
        if squared < 0.0:
            return none
        angle = atan2(cb - ca, distance + sa - sb)
        return turn_angle(angle - alpha), sqrt(squared), turn_angle(beta - angle)
    if word == 1:
        squared = 2.0 + distance * distance - 2.0 * cab + 2.0 * distance * (sb - sa)
        if squared < 0.0:
            return none
        angle = atan2(ca - cb, distance - sa + sb)
        return turn_angle(alpha - angle), sqrt(squared), turn_angle(angle - beta)
    if word == 2:
        squared = -2.0 + distance * distance + 2.0 * cab + 2.0 * distance * (sa + sb)
        if squared < 0.0:
            return none
        straight = sqrt(squared)
        angle = atan2(-ca - cb, distance + sa + sb) - atan2(-2.0, straight)
        return turn_angle(angle - alpha), straight, turn_angle(angle - beta)
    if word == 3:
        squared = -2.0 + distance * distance + 2.0 * cab - 2.0 * distance * (sa + sb)
        if squared < 0.0:
            return none
        straight = sqrt(squared)
        angle = atan2(ca + cb, distance - sa - sb) - atan2(2.0, straight)
        return turn_angle(alpha - angle), straight, turn_angle(beta - angle)
    if word == 4:
        cosine = (6.0 - distance * distance + 2.0 * cab + 2.0 * distance * (sa - sb)) / 8.0
        if abs(cosine) > 1.0:
            return none
        middle = turn_angle(2.0 * pi - acos(cosine))
        first = turn_angle(alpha - atan2(ca - cb, distance - sa + sb) + middle / 2.0)
        return first, middle, turn_angle(alpha - beta - first + middle)
    cosine = (6.0 - distance * distance + 2.0 * cab + 2.0 * distance * (sb - sa)) / 8.0
    if abs(cosine) > 1.0:
        return none
    middle = turn_angle(2.0 * pi - acos(cosine))
    first = turn_angle(atan2(cb - ca, distance + sa - sb) - alpha + middle / 2.0)
    return first, middle, turn_angle(beta - alpha - first + middle)


@njit(cache=True)
def shortest_dubins(
    ax: float, ay: float, ah: float, bx: float, by: float, bh: float, radius_m: float
) -> tuple[int, float, float, float]:
    """The shortest of the six words from pose a to pose b.

    Returns:
        word index and its three segment lengths in radii; the length in metres is their sum times
        ``radius_m``. A word always exists.
    """
    dx, dy = (bx - ax) / radius_m, (by - ay) / radius_m
    line = atan2(dy, dx)
    distance = sqrt(dx * dx + dy * dy)
    alpha, beta = ah - line, bh - line
    best, best_word, t, p, q = np.inf, 0, 0.0, 0.0, 0.0
    # beyond four radii the words of three turns cannot be shortest
    for word in range(4 if distance > 4.0 else 6):
        first, middle, last = dubins_word(word, distance, alpha, beta)
        length = first + middle + last
        if length < best:
            best, best_word, t, p, q = length, word, first, middle, last
    return best_word, t, p, q


@njit(cache=True)
def dubins_pose(
    ax: float, ay: float, ah: float,
    word: int, t: float, p: float, q: float,
    radius_m: float, along_m: float,
) -> tuple[float, float, float]:  # fmt: skip
    """The pose ``along_m`` from pose a along a word; stays at the end beyond it."""
    x, y, heading = ax, ay, ah
    left = along_m / radius_m
    for k in range(3):
        part = t if k == 0 else (p if k == 1 else q)
        go = min(part, left)
        turn = _TURNS[word, k]
        if turn == 0.0:
            x += go * radius_m * cos(heading)
            y += go * radius_m * sin(heading)
        else:
            x += turn * radius_m * (sin(heading + turn * go) - sin(heading))
            y -= turn * radius_m * (cos(heading + turn * go) - cos(heading))
            heading += turn * go
        left -= go
        if left <= 0.0:
            break
    return x, y, heading


def dubins_length_m(
    a: tuple[float, float, float], b: tuple[float, float, float], radius_m: float
) -> float:
    """Length of the shortest forward path between two poses (x_m, y_m, heading_rad)."""
    _, t, p, q = shortest_dubins(*a, *b, radius_m)
    return float(t + p + q) * radius_m
