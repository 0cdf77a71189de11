"""Rotations as viser takes them: unit quaternions w, x, y, z."""

from __future__ import annotations

import numpy as np


def of_matrices(matrices: np.ndarray) -> np.ndarray:
    """Quaternions `(n, 4)` of rotation matrices, `(n, 9)` or `(n, 3, 3)`."""
    from scipy.spatial.transform import Rotation

    matrices = np.asarray(matrices, float).reshape(-1, 3, 3)
    if not len(matrices):
        return np.empty((0, 4))
    return Rotation.from_matrix(matrices).as_quat(scalar_first=True)


def towards(directions: np.ndarray) -> np.ndarray:
    """Quaternions `(n, 4)` of the shortest turns from z to directions `(n, 3)`; none for a direction without length."""
    directions = np.asarray(directions, float).reshape(-1, 3)
    length = np.linalg.norm(directions, axis=1, keepdims=True)
    unit = np.where(length > 1e-12, directions / np.maximum(length, 1e-12), [0.0, 0.0, 1.0])
    turn = np.stack([1 + unit[:, 2], -unit[:, 1], unit[:, 0], np.zeros(len(unit))], axis=1)
    turn[unit[:, 2] < -1 + 1e-9] = (0, 1, 0, 0)  # straight down: about any level axis
    return turn / np.linalg.norm(turn, axis=1, keepdims=True)


def still(count: int) -> np.ndarray:
    """So many quaternions `(n, 4)` that turn nothing."""
    return np.tile([1.0, 0.0, 0.0, 0.0], (count, 1))
