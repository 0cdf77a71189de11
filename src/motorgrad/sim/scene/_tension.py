"""How hard muscles pull, as a share of the hardest they can."""

# pyright: reportAttributeAccessIssue=false
# (the bindings of mujoco carry no types)
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import mujoco


def peak_force(model: mujoco.MjModel) -> np.ndarray:
    """The greatest force `(nu,)` of each actuator, in N: of a muscle its strength; 0 where the model does not say."""
    import mujoco

    kinds = mujoco.mjtGain
    gain, most = np.abs(model.actuator_gainprm[:, 0]), np.abs(model.actuator_ctrlrange).max(axis=1, initial=0.0)
    peak = np.select(
        [
            model.actuator_gaintype == kinds.mjGAIN_USER,
            model.actuator_gaintype == kinds.mjGAIN_MUSCLE,
            model.actuator_forcelimited > 0,
            model.actuator_ctrllimited > 0,
        ],
        [gain, _strength(model), np.abs(model.actuator_forcerange).max(axis=1, initial=0.0), gain * most],
        0.0,
    )
    return peak


def _strength(model: mujoco.MjModel) -> np.ndarray:
    """The peak force of MuJoCo's own muscle: told, or derived from what it accelerates."""
    told, scale = model.actuator_gainprm[:, 2], model.actuator_gainprm[:, 3]
    return np.where(told > 0, told, scale / np.maximum(model.actuator_acc0, 1e-9))


def tendon_tension(model: mujoco.MjModel, force: np.ndarray) -> np.ndarray:
    """The pull on each tendon `(ntendon,)` as a share, in [0, 1], of the most that its actuators can pull together.

    **Arguments:** `force` `(nu,)`, as MuJoCo's `actuator_force`: negative where it pulls.
    """
    import mujoco

    pulls = np.flatnonzero(model.actuator_trntype == mujoco.mjtTrn.mjTRN_TENDON)
    which = model.actuator_trnid[pulls, 0]
    pull, most = np.zeros(model.ntendon), np.zeros(model.ntendon)
    np.add.at(pull, which, np.maximum(-force[pulls] * np.sign(model.actuator_gear[pulls, 0]), 0.0))
    np.add.at(most, which, peak_force(model)[pulls])
    return np.clip(pull / np.where(most > 0, most, np.inf), 0, 1)
