"""Many simulations of one body, stepped together on a thread pool."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's compiled modules carry no type information.)

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import mujoco
import numpy as np
from mujoco import batch as mujoco_batch

from motorgrad._errors import check
from motorgrad.bodies._body import START, Body, actuators_of, compile_model
from motorgrad.bodies._callback import check_muscle_callback, uses_callback

_WARNING = mujoco.mjtWarning
# MuJoCo resets a simulation in which one of these is found, with nothing but a counter to show for it.
_BAD = slice(int(_WARNING.mjWARN_BADQPOS), int(_WARNING.mjWARN_BADCTRL) + 1)
_VELOCITY_STAGE = int(mujoco.mjtStage.mjSTAGE_VEL)


class BodyState(NamedTuple):
    """What can be known of a body at one instant. NumPy or JAX arrays; any leading axes.

    - `position` (..., nq): generalised positions, m and rad.
    - `velocity` (..., nv): generalised velocities, m/s and rad/s.
    - `sensors`: by name, (..., dim), or (...) for a scalar.
    """

    position: Any
    velocity: Any
    sensors: dict[str, Any]


class BodyBatch:
    """`seeds` simulations of one body; results do not depend on the number of threads or of seeds.

    **Arguments:**

    - `body`: what to simulate; or one body for each seed, alike in their parts and different in their numbers, such as
      one body on different terrain. Equal ones share a model.
    - `seeds`: simulations, ≥ 1.
    - `substeps`: physics steps of one `step` (a decision), ≥ 1.
    - `threads`: threads including the caller's; 0 for all processors.

    **Attributes:**

    - `model`: the `mujoco.MjModel` of the first; `models`: one for each; `body` (the first), `seeds`, `substeps`,
      `groups` as given.
    - `period`: simulated seconds of one `step`.
    - `packed` (seeds, width) float32: for each seed positions, velocities, sensor readings and last a flag, 1 if the
      simulation diverged in the step just made. Refreshed in place by every call: JAX may read NumPy memory without
      copying it, so copy before the next `step` if something still reads it. Positions, velocities and the sensors of
      them are current; contact forces are those of the last substep.
    - `lost`: whether any simulation diverged in the step just made.
    - `diverged` (seeds,) int64: how often each simulation diverged. It is then put back to the start pose; the other
      simulations are not affected in any bit.

    Not safe for several Python threads at once.

    **Raises:** `ValueError` for a bad argument; `RuntimeError` if the muscle callback is foreign.
    """

    def __init__(self, body: Body | Sequence[Body], seeds: int, substeps: int = 10, threads: int = 0):
        for name, value, least in (("seeds", seeds, 1), ("substeps", substeps, 1), ("threads", threads, 0)):
            whole = isinstance(value, (int, np.integer)) and not isinstance(value, bool)
            check(whole and value >= least, name, value, f"a whole number >= {least}")
        self.seeds, self.substeps = int(seeds), int(substeps)
        if isinstance(body, Sequence):
            allowed = f"one, or one for each of {self.seeds} seeds"
            check(len(body) == self.seeds, "body", f"{len(body)} bodies", allowed)
            compiled = {each: compile_model(each) for each in dict.fromkeys(body)}
            self.models = tuple(compiled[each] for each in body)
            body = body[0]
        else:
            compiled = {}
            self.models = (compile_model(body),) * self.seeds
        self.body = body
        self.model = self.models[0]
        self.groups = tuple(body.groups)
        self.period = self.substeps * float(self.model.opt.timestep)
        self._start = _start_key(self.model)
        self._batch = mujoco_batch.Batch(self.model, self.seeds, int(threads), persistent=True)
        if len(compiled) > 1:
            for other, model in compiled.items():
                _check_alike(body, self.model, other, model)
            self._batch.set_models(self.models)
        # the first model that needs the callback speaks for all
        self._called = next(filter(uses_callback, self.models), None)
        self._callback = None if self._called is None else mujoco.get_mjcb_act_gain()
        self._layout = _Layout(self.model, body.sensor_components)
        self._bind()
        self.diverged = np.zeros(self.seeds, np.int64)
        self.lost = False
        self.reset()

    def _bind(self) -> None:
        """Views and buffers made once, so that a step makes none."""
        batch, layout = self._batch, self._layout
        driven, index = actuators_of(self.body), {group: i for i, group in enumerate(self.groups)}
        self._group_of = np.array([index[each.group] for each in driven], np.intp)
        actuators = [self.model.actuator(each.name).id for each in driven]
        # they are added one after the other, so that one slice holds their controls; others may stand around it
        first, last = actuators[0], actuators[-1] + 1
        check(actuators == list(range(first, last)), "actuators of muscles and servos", actuators, "consecutive")
        self._control = batch.bind("ctrl")[:, first:last]
        self._bad = batch.warning[:, _BAD, 1]
        self.packed = np.zeros((self.seeds, layout.width), np.float32)
        sources = (batch.bind("qpos"), batch.bind("qvel"), batch.bind("sensordata"))
        parts = (layout.position, layout.velocity, layout.sensordata)
        self._copies = tuple((self.packed[:, part], source) for part, source in zip(parts, sources, strict=True))
        self._flag = self.packed[:, -1]

    def step(self, activation: Any) -> None:
        """Advance every simulation by one decision, `substeps` physics steps.

        **Arguments:** `activation` (seeds, groups), array-like: of muscles, from 0 to 1 (MuJoCo clamps what lies
        outside); of servos, desired velocities in rad/s. NaN counts as a divergence of that seed.

        **Raises:** `ValueError` for another shape; `RuntimeError` if the muscle callback has vanished.
        """
        activation = np.asarray(activation)
        if activation.shape != (self.seeds, len(self.groups)):
            check(False, "activation.shape", activation.shape, f"(seeds, groups) = {(self.seeds, len(self.groups))}")
        self._control[...] = activation.take(self._group_of, 1)
        # the callback belongs to the process, so anyone may have taken it away since; asking costs 0.1 µs
        if self._callback is not None and mujoco.get_mjcb_act_gain() is not self._callback:
            check_muscle_callback(self._called)
        failed = None
        try:
            self._batch.step(None, self.substeps, _VELOCITY_STAGE)
        except mujoco_batch.SimulationError as error:
            failed = error.ids
        for target, source in self._copies:
            target[...] = source
        self._flag.fill(0.0)
        self.lost = failed is not None or bool(np.count_nonzero(self._bad))
        if self.lost:
            self._recover(failed)

    def _recover(self, failed: np.ndarray | None) -> None:
        """Put diverged simulations back to the start, flag and count them."""
        lost = self._bad.any(axis=1)
        if failed is not None:
            lost[failed] = True
        rows = np.flatnonzero(lost)
        self.diverged[rows] += 1
        self.reset(rows)
        self._flag[rows] = 1.0

    def reset(self, rows: Any = None) -> None:
        """Put simulations to the start pose.

        **Arguments:** `rows`: which seeds, an integer or boolean array; None for all. `packed` is refreshed for these
        rows, with their flag 0; `diverged` stays.
        """
        rows = np.arange(self.seeds) if rows is None else _rows(rows, self.seeds)
        if not rows.size:
            return
        self._batch.reset(rows, self._start)
        self._bad[rows] = 0
        for target, source in self._copies:
            target[rows] = source[rows]
        self._flag[rows] = 0.0

    def push(self, body: int, force: Any) -> None:
        """Let a force act on a part of every body, at its centre of mass, until another is given or the body is reset.

        **Arguments:** `body`: the part's number in the model; `force` (3,) or (seeds, 3): in N, world coordinates.
        """
        check(0 < body < self.model.nbody, "body", body, f"from 1 to {self.model.nbody - 1}")
        self._batch.bind("xfrc_applied")[:, body, :3] = force

    def refresh_models(self) -> None:
        """Go on with the models as they are now, after numbers in them were changed; their parts must stay the same."""
        state = self._batch.state.copy()
        self._batch.set_models(self.models)
        np.copyto(self._batch.state, state)

    def unpack(self, packed: Any) -> BodyState:
        """The named parts of `packed`, or of any array (..., width), by slicing only (NumPy, JAX, tracers)."""
        return self._layout.unpack(packed)

    def snapshot(self) -> dict[str, np.ndarray]:
        """All that `restore` needs, copied: physics `state` (seeds, n), `packed`, `diverged`."""
        return {"state": self._batch.state.copy(), "packed": self.packed.copy(), "diverged": self.diverged.copy()}

    def restore(self, snapshot: Mapping[str, np.ndarray]) -> None:
        """Go back to a snapshot of this or of an equal batch; what follows is the same to the last bit.

        **Raises:** `ValueError` for a snapshot of another shape.
        """
        targets = {"state": self._batch.state, "packed": self.packed, "diverged": self.diverged}
        check(set(snapshot) == set(targets), "snapshot", sorted(snapshot), f"a mapping with {sorted(targets)}")
        for name, target in targets.items():
            shape = np.shape(snapshot[name])
            check(shape == target.shape, f"snapshot[{name!r}].shape", shape, f"{target.shape}")
        for name, target in targets.items():
            np.copyto(target, snapshot[name])
        self._bad[...] = 0


class _Layout:
    """Where in a packed row each thing is."""

    def __init__(self, model: mujoco.MjModel, components: Mapping[str, int]):
        nq, nv, ns = int(model.nq), int(model.nv), int(model.nsensordata)
        self.position, self.velocity = slice(0, nq), slice(nq, nq + nv)
        self.sensordata = slice(nq + nv, nq + nv + ns)
        self.width = nq + nv + ns + 1
        self.sensors: dict[str, int | slice] = {}
        for i in range(model.nsensor):
            sensor = model.sensor(i)
            first, size = nq + nv + int(sensor.adr[0]), int(sensor.dim[0])
            if sensor.name in components:
                self.sensors[sensor.name] = first + components[sensor.name]
            else:
                self.sensors[sensor.name] = first if size == 1 else slice(first, first + size)

    def unpack(self, packed: Any) -> BodyState:
        width = packed.shape[-1]
        check(width == self.width, "packed.shape[-1]", width, f"{self.width}")
        sensors = {name: packed[..., where] for name, where in self.sensors.items()}
        return BodyState(packed[..., self.position], packed[..., self.velocity], sensors)


def _check_alike(body: Body, model: mujoco.MjModel, other: Body, its: mujoco.MjModel) -> None:
    """Refuse bodies that one batch cannot hold, or whose columns would not mean the same."""
    names = [each.name for each in actuators_of(body)]
    for what, mine, yours in (
        ("groups", tuple(body.groups), tuple(other.groups)),
        ("actuators", names, [each.name for each in actuators_of(other)]),
        ("sensors", model.sensor_adr.tolist(), its.sensor_adr.tolist()),
        ("timestep", model.opt.timestep, its.opt.timestep),
    ):
        check(mine == yours, f"{what} of a body of the batch", yours, f"those of the first, {mine}")


def _start_key(model: mujoco.MjModel) -> int:
    names = [model.key(i).name for i in range(model.nkey)]
    check(START in names, "keyframes of the body", names, f"such that one is {START!r}")
    return names.index(START)


def _rows(rows: Any, seeds: int) -> np.ndarray:
    """Sorted unique row numbers from row numbers or a mask."""
    rows = np.asarray(rows)
    if rows.dtype == bool:
        check(rows.shape == (seeds,), "rows.shape", rows.shape, f"({seeds},) for a mask")
        return np.flatnonzero(rows)
    rows = np.unique(rows) if rows.size else np.zeros(0, np.int64)
    whole = np.issubdtype(rows.dtype, np.integer)
    check(whole and (not rows.size or (rows[0] >= 0 and rows[-1] < seeds)), "rows", rows, f"whole, 0 to {seeds - 1}")
    return rows
