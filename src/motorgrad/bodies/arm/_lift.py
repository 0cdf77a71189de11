"""How high an arm lifts its load: by simulation, and interpolated from a table of simulations."""

import dataclasses
import functools
import io
import json
import math
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar

import jax.numpy as jnp
import mujoco
import numpy as np
import numpy.typing as npt
from jaxtyping import Array, Float

from motorgrad._arrays import Real
from motorgrad._errors import check
from motorgrad._files import read_arrays, write_atomically
from motorgrad._limits import MAX_ARRAY_BYTES
from motorgrad._reading import json_in, numbers_in
from motorgrad.bodies._batch import BodyBatch
from motorgrad.bodies.arm._arm import POSTURES, Arm, Posture
from motorgrad.schema import build, table

STORED: Mapping[Posture, Path] = {each: Path(__file__).with_name(f"arm_lift_{each}.npz") for each in POSTURES}
LOADS = 41
SHARES = 81
SECONDS = 2.0
MAX_FORCE = 1e7  # N; beyond about 1e9 simulations diverge
_ROWS = 17
_ROUNDS = 4
_CROWDED: Mapping[Posture, int] = {"vertical": 4, "horizontal": 1}
"""The power of equally spaced numbers by which the tabulated forces approach the one that reaches the top: below a
vertical upper arm, the load snaps up within the last per cent."""


def greatest_flexion(
    arm: Arm, activation: Sequence[float] | np.ndarray, seconds: float = SECONDS, threads: int = 0
) -> Float[np.ndarray, " rows"]:
    """Simulate the greatest flexion of the elbow within `seconds`, from rest under a constant activation.

    **Arguments:** the arm with its load; `activation` (rows,), from 0 to 1, one simulation each; `seconds`, in
    simulated time; `threads` as in `BodyBatch`.

    **Returns:** flexions in rad, from 0 to the stop. (The stop gives way a little on impact; that is clipped.)

    **Raises:** `RuntimeError` as soon as a simulation diverges.
    """
    active: Any = np.asarray(activation, float)
    check(active.ndim == 1 and len(active) > 0, "activation.shape", active.shape, "(rows,), at least one")
    check(((active >= 0) & (active <= 1)).all(), "activation", active.tolist(), "from 0 to 1")
    check(arm.timestep <= seconds < math.inf, "seconds", seconds, f"at least one time step, {arm.timestep} s")
    batch = BodyBatch(arm, len(active), substeps=1, threads=threads)
    action = active[:, None]
    most = np.zeros(len(active), np.float32)
    for _ in range(round(seconds / arm.timestep)):
        batch.step(action)
        if batch.lost:
            raise RuntimeError(f"the arm's simulation diverged at activation {active[batch.diverged > 0][0]:g}: {arm}")
        np.maximum(most, batch.packed[:, 0], out=most)
    return np.minimum(most.astype(float), arm.most_flexion)


def lift(arm: Arm, load: npt.ArrayLike, force: npt.ArrayLike) -> np.ndarray:
    """Simulate the greatest height to which a constant force lifts a load within 2 s from rest.

    **Arguments:** the arm, whose own `load` and `strength` are ignored; `load` in kg, at least 0, and `force` in N,
    from 0 to 1e7, which broadcast.

    **Returns:** the height as a fraction of the full lift, from 0 to 1.

    **Raises:** `ValueError` naming the first load or force out of range.
    """
    loads, forces = np.broadcast_arrays(np.asarray(load, float), np.asarray(force, float))
    _check_each("load", loads, (loads >= 0) & (loads < math.inf), "a finite number >= 0, in kg")
    _check_each("force", forces, (forces >= 0) & (forces <= MAX_FORCE), f"from 0 to {MAX_FORCE:g} N")
    found = np.zeros(loads.shape)
    for each in np.unique(loads):
        rows = loads == each
        found[rows] = _lift(dataclasses.replace(arm, load=float(each)), forces[rows])
    return found


@dataclasses.dataclass(frozen=True, eq=False)
class LiftTable:
    """`lift` of one arm, simulated once on a grid and interpolated afterwards.

    Without friction, the height depends on the force only through its ratio to `Arm.throwing_force`, the force that
    just reaches the top. So one axis of the grid is the load, and the other the force as a fraction of the one that
    just reaches the top with that load. The tabulated function is then smooth, with its kink at the border. The loads
    are squares of equally spaced numbers, because friction matters most for light loads.

    The forces are equally spaced for a horizontal upper arm. Between grid points the error is then below 3e-4 of the
    full lift from 0.5 kg on, below 5e-4 from 50 g, and below 1.5e-3 for smaller loads. Below a vertical upper arm the
    height jumps from less than half of the lift to all of it over the last per cent of the force, so the forces are
    crowded there: what a force lacks of the one that reaches the top is the fourth power of equally spaced numbers.
    Up to 98 % of that force the error is below 3e-4 of the full lift from 50 g on and below 1e-3 for smaller loads; in
    the last two per cent it is below 1e-2 from 0.5 kg on, below 2e-2 from 50 g, and below 4e-2 for smaller loads.

    **Arguments:**

    - `arm`: the arm; its load and strength do not matter.
    - `effort` (loads,): the force that just reaches the top, divided by `Arm.throwing_force`.
    - `height` (loads, shares): the height as a fraction of the full lift, for shares of that force from 0 to 1.
    - `mujoco_version`: the MuJoCo version that simulated it; by default the present one.

    **Attributes:** `heaviest`, the greatest load in kg, 20.
    """

    heaviest: ClassVar[float] = 20.0

    arm: Arm
    effort: Float[np.ndarray, " loads"]
    height: Float[np.ndarray, "loads shares"]
    mujoco_version: str = mujoco.__version__

    def lift(self, load: Real, force: Real) -> Float[Array, "..."]:
        """The function `lift`, interpolated linearly; a JAX function of arrays that broadcast.

        Loads are clipped to 0 … 20 kg.
        """
        load = jnp.clip(jnp.asarray(load, jnp.result_type(float)), 0.0, self.heaviest)
        row, down = _place(jnp.sqrt(load / self.heaviest), len(self.effort))
        effort, height = (jnp.asarray(part, load.dtype) for part in (self.effort, self.height))
        light, heavy = (self.arm_with(mass).throwing_force for mass in (0.0, self.heaviest))
        throw = light + (heavy - light) * load / self.heaviest
        top = throw * ((1 - down) * effort[row] + down * effort[row + 1])
        spread = 1.0 / _CROWDED[self.arm.posture]
        column, right = _place(1.0 - (1.0 - jnp.clip(force / top, 0.0, 1.0)) ** spread, height.shape[1])
        above = (1 - right) * height[row, column] + right * height[row, column + 1]
        below = (1 - right) * height[row + 1, column] + right * height[row + 1, column + 1]
        return (1 - down) * above + down * below

    def top_force(self, load: float) -> float:
        """The force in N that just lifts a load, from 0 to 20 kg, to the top."""
        check(0 <= load <= self.heaviest, "load", load, f"from 0 to {self.heaviest:g} kg")
        effort = np.interp(math.sqrt(load), np.sqrt(_loads(len(self.effort))), self.effort)
        return float(effort * self.arm_with(load).throwing_force)

    def arm_with(self, load: float) -> Arm:
        """The arm with that load in its hand."""
        return dataclasses.replace(self.arm, load=float(load))

    def save(self, path: Path) -> None:
        """Write the table to a file, with the arm and the version it was made from."""
        made = {"arm": table(self.arm), "mujoco": self.mujoco_version, **_meaning()}
        content = io.BytesIO()
        np.savez_compressed(content, effort=self.effort, height=self.height, made=json.dumps(made))
        write_atomically(path, content.getvalue())

    @classmethod
    def load(cls, path: Path) -> "LiftTable":
        """Read a table from a file.

        **Raises:** `ValueError` that names the file if it was made for another duration, or for another range of loads,
        and if it is no such table.
        """
        file = read_arrays(path)
        try:
            check({"made", "effort", "height"} <= file.keys(), "arrays", sorted(file), "made, effort and height")
            made = json_in(str(file["made"]))
            check(isinstance(made, dict) and isinstance(made.get("arm"), dict), "made", made, "how the table was made")
            for name, value in _meaning().items():
                check(made.get(name) == value, name, made.get(name), f"{value:g}")
            effort, height = (numbers_in(file[name], MAX_ARRAY_BYTES) for name in ("effort", "height"))
            grid = effort.ndim == 1 and height.ndim == 2 and len(height) == len(effort) >= 2 and height.shape[1] >= 2
            check(grid, "shapes", (effort.shape, height.shape), "(loads,) and (loads, shares), at least 2 of each")
            check(np.isfinite(effort).all() and np.isfinite(height).all(), "numbers", "not finite", "finite")
            return cls(build(Arm, made["arm"]), effort, height, str(made.get("mujoco", "unknown")))
        except ValueError as error:
            raise ValueError(f"{path}: {error}") from None


def tabulate_lift(arm: Arm, loads: int = LOADS, shares: int = SHARES) -> LiftTable:
    """Simulate the table of an arm: some thousand lifts of 2 s, about a minute on one core.

    **Arguments:** the arm, whose own `load` and `strength` are ignored; the numbers of loads and of forces, ≥ 2.
    """
    check(loads >= 2, "loads", loads, "at least 2")
    check(shares >= 2, "shares", shares, "at least 2")
    effort = np.zeros(loads)
    height = np.zeros((loads, shares))
    for row, load in enumerate(_loads(loads)):
        one = dataclasses.replace(arm, load=float(load))
        top = _top_force(one)
        effort[row] = top / one.throwing_force
        height[row] = _lift(one, (1.0 - np.linspace(1.0, 0.0, shares) ** _CROWDED[arm.posture]) * top)
    height[:, -1] = 1.0
    return LiftTable(arm, effort, height)


def lift_table(arm: Arm) -> LiftTable:
    """The table of an arm: one of the two shipped with the library if it fits, else one that is simulated on first use.

    Arms that differ only in load, strength or height above the floor share a table. As a simulation takes a minute or
    two, it is announced on standard error.
    """
    default = Arm(posture=arm.posture)
    return _table(
        dataclasses.replace(arm, load=default.load, strength=default.strength, elbow_height=default.elbow_height)
    )


@functools.cache
def _table(arm: Arm) -> LiftTable:
    stored = LiftTable.load(STORED[arm.posture])
    if stored.arm == arm:
        return stored
    print("motorgrad: simulating how high this arm lifts loads, for a minute or two", file=sys.stderr, flush=True)
    return tabulate_lift(arm)


def _meaning() -> dict[str, float]:
    """What the numbers of a stored table depend on, apart from the arm."""
    return {"seconds": SECONDS, "heaviest": LiftTable.heaviest}


def _check_each(name: str, values: np.ndarray, allowed: np.ndarray, words: str) -> None:
    """Refuse the first value that is not allowed."""
    if not allowed.all():
        check(False, name, float(values[~allowed][0]), words)


def _lift(arm: Arm, force: np.ndarray) -> np.ndarray:
    """The heights, as fractions of the full lift, to which an arm lifts its load under several forces in N."""
    strength = max(float(np.max(force)), 1e-9)
    most = greatest_flexion(dataclasses.replace(arm, strength=strength), force / strength)
    return np.asarray(arm.rise(most)) / float(arm.rise(arm.most_flexion))


def _top_force(arm: Arm) -> float:
    """The force in N that just reaches the top: repeated bisection, many forces at once."""
    low = arm.throwing_force
    high = 1.1 * arm.throwing_force
    while _lift(arm, np.array([high]))[0] < 1.0:
        low = high
        high = 2.0 * high
    for _ in range(_ROUNDS):
        tried = np.linspace(low, high, _ROWS)
        first = max(1, int(np.argmax(_lift(arm, tried) >= 1.0)))
        low = tried[first - 1]
        high = tried[first]
    return high


def _loads(count: int) -> np.ndarray:
    return LiftTable.heaviest * np.linspace(0.0, 1.0, count) ** 2


def _place(share: Array, count: int) -> tuple[Array, Array]:
    """Where a number from 0 to 1 lies among `count` grid points: the index of the lower one, and the fraction of the
    way to the next."""
    place = share * (count - 1)
    first = jnp.clip(jnp.floor(place), 0, count - 2)
    return first.astype(jnp.int32), place - first
