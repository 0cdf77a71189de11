"""The wrapped path taken apart: what is measured of it, and how far that is from the formulas of appendix A.2."""

import numpy as np

from motorgrad.bodies import wrapped_length, wrapped_rate, wrapping_angle
from motorgrad.experiments._joint_drawing import flat_path

Shape = tuple[float, float, float]
"""Distances of A and B from the capsule's centre, and its radius, in m."""
STEP = 1e-6  # rad, of finite differences


def ends(angle: float, shape: Shape) -> np.ndarray:
    """A and B about the origin, `(2, 2)`: the angle θ between them lies below, the muscle passes above."""
    left, right = -np.pi / 2 - angle / 2, -np.pi / 2 + angle / 2
    return np.array([shape[0] * turned(left), shape[1] * turned(right)])


def turned(angle: float) -> np.ndarray:
    """The unit vector at an angle from the right, anticlockwise."""
    return np.array([np.cos(angle), np.sin(angle)])


def path_at(angle: float, shape: Shape, arc: int = 2) -> np.ndarray:
    """The muscle's path at θ: two points where it is straight, else `arc + 2`."""
    start, stop = ends(angle, shape)
    return flat_path(start, stop, shape[2], np.array([0.0, 1.5 * shape[2]]), arc)


def measure(angle: float, shape: Shape) -> np.ndarray:
    """What is seen of a wrapped path: lengths of its tangent at A, its arc and its tangent at B (m), and the angles at
    the centre, α_A, β and α_B (rad)."""
    start, touches, leaves, stop = path_at(angle, shape)
    beta = _angle(touches, leaves)
    lengths = (np.linalg.norm(touches - start), shape[2] * beta, np.linalg.norm(stop - leaves))
    return np.array([*lengths, _angle(start, touches), beta, _angle(leaves, stop)])


def _angle(first: np.ndarray, then: np.ndarray) -> float:
    """From one direction clockwise to another, as the muscle turns from A to B."""
    return float((np.arctan2(first[1], first[0]) - np.arctan2(then[1], then[0])) % (2 * np.pi))


def first_touch(shape: Shape) -> float:
    """The θ below which the path touches the capsule, found by halving."""
    low, high = 0.5, 2 * np.pi - 1e-3
    while high - low > 1e-12:
        middle = (low + high) / 2
        low, high = (middle, high) if len(path_at(middle, shape)) > 2 else (low, middle)
    return low


def deviations(shape: Shape) -> dict[str, float]:
    """How far the formulas are from the path itself, the greatest over angles: `onset` (rad), `parts` (m), `jump` (m),
    `wrapped_rate` and `straight_rate` (m/rad), `constant` (m or rad)."""
    critical = float(wrapping_angle(*shape))
    wrapping = np.linspace(0.2, critical - 0.01, 12)
    straight = np.linspace(critical + 0.01, 2 * np.pi - 0.05, 12)
    seen = np.array([measure(angle, shape) for angle in wrapping])
    slope = (wrapped_length(wrapping + STEP, *shape) - wrapped_length(wrapping - STEP, *shape)) / (2 * STEP)
    apart, before, after = (
        np.array([np.subtract(*ends(angle, shape)) for angle in straight + shift]) for shift in (0.0, -STEP, STEP)
    )
    stated = np.sum(apart * (after - before) / (2 * STEP), axis=1) / np.linalg.norm(apart, axis=1)
    return {
        "onset": abs(first_touch(shape) - critical),
        "parts": float(np.abs(seen[:, :3].sum(axis=1) - wrapped_length(wrapping, *shape)).max()),
        "jump": float(np.ptp(wrapped_length(np.nextafter(critical, (0.0, 7.0)), *shape))),
        "wrapped_rate": float(np.abs(slope + shape[2]).max()),
        "straight_rate": float(np.abs(wrapped_rate(straight, 1.0, *shape) - stated).max()),
        "constant": float(np.ptp(seen[:, [0, 2, 3, 5]], axis=0).max()),
    }
