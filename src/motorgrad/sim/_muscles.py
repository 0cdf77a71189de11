"""How a muscle looks: which tendon it pulls, and the colour and width its activation gives it."""

# pyright: reportAttributeAccessIssue=false
# (the bindings of mujoco carry no types)
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import mujoco

SILENT = np.array([0.95, 0.70, 0.66])
FIRING = np.array([0.80, 0.02, 0.06])
PASSIVE = np.array([0.50, 0.53, 0.57])  # a tendon that no actuator pulls

SWELL = 1.1  # a fully active muscle is drawn 1 + SWELL times as wide as a silent one
LEAST = 0.006  # of the size of what is seen


def tendon_activation(model: mujoco.MjModel, activation: np.ndarray) -> np.ndarray:
    """The activation of each tendon: `(ntendon,)`, that of its most active muscle, NaN where no actuator pulls it."""
    import mujoco

    pulls = np.flatnonzero(model.actuator_trntype == mujoco.mjtTrn.mjTRN_TENDON)
    level = np.full(model.ntendon, np.nan)
    np.fmax.at(level, model.actuator_trnid[pulls, 0], np.asarray(activation, float)[pulls])
    return level


def colour(level: np.ndarray) -> np.ndarray:
    """RGB `(n, 3)` in [0, 1] of muscles at `level` `(n,)`: pale when silent, strong red when firing, grey at NaN."""
    level = level[:, None]
    blend = SILENT + np.nan_to_num(level) * (FIRING - SILENT)
    return np.where(np.isnan(level), PASSIVE, blend)


def width(level: np.ndarray) -> np.ndarray:
    """Width `(n,)` relative to a silent muscle's."""
    return 1 + SWELL * np.nan_to_num(level)


def least_width(model: mujoco.MjModel, size: float) -> np.ndarray:
    """Radius `(ntendon,)` of a silent muscle, in m: the model's own, but not too thin to see on a body of `size` m."""
    return np.maximum(model.tendon_width, LEAST * size)
