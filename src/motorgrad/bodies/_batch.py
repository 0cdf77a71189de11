"""Many simulations of one body, stepped together on a thread pool."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's compiled modules carry no type information.)

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, Protocol

import jax
import mujoco
import numpy as np
import numpy.typing as npt
from jaxtyping import Float
from mujoco import batch as mujoco_batch

from motorgrad._arrays import AnyArray
from motorgrad._errors import check, check_integer, unknown
from motorgrad.bodies._body import START, Body, actuators_of, compile_model, group_places
from motorgrad.bodies.muscles._callback import callback_getter, callbacks_of, check_muscle_callback
from motorgrad.bodies.muscles._hill import fibers, settle

_WARNING = mujoco.mjtWarning
# On one of these, MuJoCo resets the simulation silently and only increments a counter.
_BAD = slice(int(_WARNING.mjWARN_BADQPOS), int(_WARNING.mjWARN_BADCTRL) + 1)
_VELOCITY_STAGE = int(mujoco.mjtStage.mjSTAGE_VEL)


class Sensors(dict[str, Any]):
    """Sensor readings by name: a `dict` that suggests the nearest name for an unknown one, with a `ValueError`.

    JAX treats it as it does a `dict`.
    """

    def __missing__(self, name: object) -> Any:
        raise unknown("sensor", name, self)


def _flatten(sensors: Sensors) -> tuple[list[tuple[Any, Any]], tuple[str, ...]]:
    names = tuple(sorted(sensors))
    return [(jax.tree_util.DictKey(name), sensors[name]) for name in names], names


jax.tree_util.register_pytree_with_keys(
    Sensors, _flatten, lambda names, values: Sensors(zip(names, values, strict=True))
)


class BodyState(NamedTuple):
    """The state of a body. NumPy or JAX arrays with any leading axes.

    - `position` (..., nq): generalised positions, m and rad.
    - `velocity` (..., nv): generalised velocities, m/s and rad/s.
    - `sensors`: by name, (..., dim), or (...) for a scalar; an unknown name is a `ValueError` with the nearest one.
    - `activation` (..., na): the state of activation dynamics, such as that of MuJoCo's muscles; `None` without any. A
      Hill-type muscle whose tendon stretches has two: the length of its fiber, as a multiple of the optimal one, first.
    """

    position: Any
    velocity: Any
    sensors: dict[str, Any]
    activation: Any = None


class Watcher(Protocol):
    """Looks on while a batch makes a decision: called before its first physics step, with the controls in place, after
    every `every` of them, and after the last, before a diverged simulation restarts. It must change nothing."""

    every: int

    def __call__(self, made: int, /) -> None:
        """Look, after `made` physics steps of the decision."""


class BodyBatch:
    """`seeds` simulations of one body. Results do not depend on the number of threads or of seeds.

    **Arguments:**

    - `body`: the body to simulate; or one body per seed, with equal parts and different numbers, such as a body on
      different terrains. Equal bodies share a model.
    - `seeds`: number of simulations, ≥ 1.
    - `substeps`: physics steps per `step` (one decision), ≥ 1.
    - `threads`: number of threads including the caller's; 0 for one per processor.

    **Attributes:**

    - `model`: the first `mujoco.MjModel`; `models`: one per seed; `body` (the first), `seeds`, `substeps`, `groups` as
      given.
    - `period`: simulated seconds per `step`.
    - `packed` (seeds, width) float32: for each seed positions, velocities, activations where the model has any, sensor
      readings, and a final flag that is 1 if the simulation diverged in the last step. Updated in place by every call.
      JAX may read NumPy memory without copying, so copy it before the next `step` if something still reads it.
      Positions, velocities and sensors derived from them are current; contact forces are those of the last substep.
    - `lost`: whether any simulation diverged in the last step.
    - `diverged` (seeds,) int64: how often each simulation diverged. A diverged simulation restarts from the start pose;
      the others are unaffected, bit for bit.
    - `watcher`: who looks on at every step (`Watcher`); `None` for nobody.

    Not safe for concurrent use by several Python threads.

    **Raises:** `ValueError` for a bad argument; `RuntimeError` if another muscle callback is installed.

    ```python
    batch = mg.bodies.BodyBatch(mg.bodies.Hopper(), seeds=16)
    batch.step(np.ones((16, 2)))
    heights = batch.unpack(batch.packed).sensors["foot_height"]
    ```
    """

    def __init__(self, body: Body | Sequence[Body], seeds: int, substeps: int = 10, threads: int = 0):
        for name, value, least in (("seeds", seeds, 1), ("substeps", substeps, 1), ("threads", threads, 0)):
            check_integer(name, value, least)
        self.seeds = int(seeds)
        self.substeps = int(substeps)
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
        self._start = start_key(body, self.model)
        self._batch = mujoco_batch.Batch(self.model, self.seeds, int(threads), persistent=True)
        if len(compiled) > 1:
            for other, model in compiled.items():
                _check_alike(body, self.model, other, model)
            self._batch.set_models(self.models)
        # any model that needs a callback will do for the check
        self._called = {name: model for model in compiled.values() or self.models[:1] for name in callbacks_of(model)}
        self._callbacks = tuple((name, get := callback_getter(name), get()) for name in self._called)
        self._layout = _Layout(self.model, body.sensor_components)
        self._bind()
        self.diverged = np.zeros(self.seeds, np.int64)
        self.lost = False
        self.watcher: Watcher | None = None
        self.reset()

    def _bind(self) -> None:
        """Make all views and buffers once, so that a step allocates none."""
        batch, layout = self._batch, self._layout
        self._group_of = np.array(group_places(self.body), np.intp)
        actuators = [self.model.actuator(each.name).id for each in actuators_of(self.body)]
        # the actuators are consecutive, so one slice holds their controls; a model may have others before or after
        first, last = (actuators[0], actuators[-1] + 1) if actuators else (0, 0)
        check(actuators == list(range(first, last)), "actuators of muscles and servos", actuators, "consecutive")
        self._control = batch.bind("ctrl")[:, first:last]
        self._bad = batch.warning[:, _BAD, 1]
        self.packed = np.zeros((self.seeds, layout.width), np.float32)
        parts = {"qpos": layout.position, "qvel": layout.velocity, "act": layout.activation}
        parts["sensordata"] = layout.sensordata
        # MuJoCo gives an array without entries another shape
        filled = {name: part for name, part in parts.items() if part.stop > part.start}
        self._copies = tuple((self.packed[:, part], batch.bind(name)) for name, part in filled.items())
        self._flag = self.packed[:, -1]
        self._lengths = batch.bind("actuator_length") if len(fibers(self.model)) else None

    def step(self, control: npt.ArrayLike) -> None:
        """Advance every simulation by one decision, that is `substeps` physics steps.

        **Arguments:** `control` (seeds, groups), array-like: for muscles from 0 to 1 (MuJoCo clamps values
        outside), servo velocities in rad/s, for an `Mjcf` the control of each actuator. NaN counts as a divergence of
        that seed.

        **Raises:** `ValueError` for another shape; `RuntimeError` if the muscle callback was removed.
        """
        control = np.asarray(control)
        if control.shape != (self.seeds, len(self.groups)):
            check(False, "control.shape", control.shape, f"(seeds, groups) = {(self.seeds, len(self.groups))}")
        self._control[...] = control.take(self._group_of, 1)
        # a callback is process-wide, so it may have been removed since; the check costs some 0.1 µs
        for name, current, installed in self._callbacks:
            if current() is not installed:
                check_muscle_callback(self._called[name])
        failed = self._moved(self.substeps) if self.watcher is None else self._watched(self.watcher)
        for target, source in self._copies:
            target[...] = source
        self._flag.fill(0.0)
        self.lost = failed is not None or bool(np.count_nonzero(self._bad))
        if self.lost:
            self._recover(failed)

    def _moved(self, steps: int) -> np.ndarray | None:
        """Make physics steps. Returns which simulations failed, or none."""
        try:
            self._batch.step(None, steps, _VELOCITY_STAGE)
        except mujoco_batch.SimulationError as error:
            return error.ids
        return None

    def _watched(self, watcher: "Watcher") -> np.ndarray | None:
        """Make the physics steps of a decision while `watcher` looks on; the bodies move as they do without it."""
        failed = np.zeros(self.seeds, bool)
        for made in range(0, self.substeps, watcher.every):
            watcher(made)
            lost = self._moved(min(watcher.every, self.substeps - made))
            if lost is not None:
                failed[lost] = True
        watcher(self.substeps)
        return np.flatnonzero(failed) if failed.any() else None

    @property
    def physics(self) -> Float[np.ndarray, "seeds numbers"]:
        """The whole state of the physics, to read: it is updated in place."""
        return self._batch.state

    @property
    def gravity(self) -> Float[np.ndarray, "seeds 3"] | None:
        """The gravity of each simulation, m/s², to read, where it is not the model's."""
        return self._batch.expanded("opt.gravity")

    def _recover(self, failed: np.ndarray | None) -> None:
        """Restart diverged simulations, set their flag and count them."""
        lost = self._bad.any(axis=1)
        if failed is not None:
            lost[failed] = True
        rows = np.flatnonzero(lost)
        self.diverged[rows] += 1
        self.reset(rows)
        self._flag[rows] = 1.0

    def reset(
        self,
        rows: Sequence[int] | np.ndarray | None = None,
        position: npt.ArrayLike | None = None,
        velocity: npt.ArrayLike | None = None,
        activation: npt.ArrayLike | None = None,
    ) -> None:
        """Put simulations into the start pose, or into another.

        **Arguments:**

        - `rows`: which seeds, as an integer or boolean array; None for all. Their rows of `packed` are updated, with
          flag 0; `diverged` is kept.
        - `position` (rows, nq), `velocity` (rows, nv), `activation` (rows, na): the state of each, in the order of
          `rows`; by default that of the start pose. A fiber of length 0 is put in balance with its tendon, at rest.

        **Raises:** `ValueError` for rows that do not exist, for arrays of another shape, and for numbers that are not
        finite.
        """
        rows, order = _rows(np.arange(self.seeds) if rows is None else rows, self.seeds)
        if not rows.size:
            return
        given = {"qpos": position, "qvel": velocity, "act": activation}
        chosen = {name: np.asarray(values, float) for name, values in given.items() if values is not None}
        targets = {name: self._batch.bind(name) for name in chosen}
        for name, values in chosen.items():
            wanted = (len(order), targets[name].shape[1])
            check(values.shape == wanted, f"{name}.shape", values.shape, f"(rows, {name}) = {wanted}")
            # MuJoCo would put the row into the reference pose instead, and say nothing
            right = np.abs(values) <= mujoco.mjMAXVAL
            check(right.all(), name, values[~right][:1].tolist(), f"finite and at most {mujoco.mjMAXVAL:g} in size")
        if not chosen:
            self._batch.reset(rows, self._start)
        else:
            self._batch.reset(rows, self._start, mujoco.mjtStage.mjSTAGE_NONE)
            for name, values in chosen.items():
                targets[name][rows] = values[order]
            self._batch.forward(rows)
        if self._lengths is not None:
            states = self._batch.bind("act")
            for row in rows:  # each has a model of its own
                settle(self.models[row], states[row : row + 1], self._lengths[row : row + 1])
            self._batch.forward(rows)
        self._bad[rows] = 0
        for target, source in self._copies:
            target[rows] = source[rows]
        self._flag[rows] = 0.0

    def push(self, body: int, force: npt.ArrayLike) -> None:
        """Apply a force to one part of every body, at its centre of mass, until another force is set or the body is
        reset.

        **Arguments:** `body`: the part's number in the model; `force` (3,) or (seeds, 3): in N, world coordinates.
        """
        check(0 < body < self.model.nbody, "body", body, f"from 1 to {self.model.nbody - 1}")
        self._batch.bind("xfrc_applied")[:, body, :3] = force

    def refresh_models(self) -> None:
        """Continue with the current models after numbers in them were changed. Their structure must be unchanged."""
        state = self._batch.state.copy()
        self._batch.set_models(self.models)
        np.copyto(self._batch.state, state)

    @property
    def unpack(self) -> Callable[[Any], BodyState]:
        """The function that unpacks `packed`, or any array (..., width), by name: by slicing only, so it takes NumPy,
        JAX and tracers. It knows the layout alone, so compiled code that holds it keeps no simulation alive."""
        return self._layout.unpack

    def snapshot(self) -> dict[str, np.ndarray]:
        """Everything `restore` needs, copied: physics `state` (seeds, n), `packed`, `diverged`."""
        return {"state": self._batch.state.copy(), "packed": self.packed.copy(), "diverged": self.diverged.copy()}

    def restore(self, snapshot: Mapping[str, np.ndarray]) -> None:
        """Return to a snapshot of this batch or an equal one. The simulation continues bit for bit.

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
    """Where each quantity is in a packed row."""

    def __init__(self, model: mujoco.MjModel, components: Mapping[str, int]):
        nq = int(model.nq)
        nv = int(model.nv)
        na = int(model.na)
        ns = int(model.nsensordata)
        self.position = slice(0, nq)
        self.velocity = slice(nq, nq + nv)
        moved = nq + nv + na
        self.activation = slice(nq + nv, moved)
        self.sensordata = slice(moved, moved + ns)
        self.width = moved + ns + 1
        self.sensors: dict[str, int | slice] = {}
        sizes = {model.sensor(i).name: int(model.sensor_dim[i]) for i in range(model.nsensor)}
        for name, index in components.items():
            if name not in sizes:
                raise unknown("sensor in sensor_components", name, sizes)
            check_integer(f"sensor_components[{name!r}]", index, 0, sizes[name] - 1)
        for i in range(model.nsensor):
            sensor = model.sensor(i)
            first = moved + int(sensor.adr[0])
            size = int(sensor.dim[0])
            if sensor.name in components:
                self.sensors[sensor.name] = first + components[sensor.name]
            else:
                self.sensors[sensor.name] = first if size == 1 else slice(first, first + size)

    def unpack(self, packed: AnyArray) -> BodyState:
        width = packed.shape[-1]
        check(width == self.width, "packed.shape[-1]", width, f"{self.width}")
        sensors = Sensors({name: packed[..., where] for name, where in self.sensors.items()})
        active = packed[..., self.activation] if self.activation.stop > self.activation.start else None
        return BodyState(packed[..., self.position], packed[..., self.velocity], sensors, active)


def _check_alike(body: Body, model: mujoco.MjModel, other: Body, its: mujoco.MjModel) -> None:
    """Refuse bodies that one batch cannot hold, or whose columns would differ in meaning."""
    names = [each.name for each in actuators_of(body)]
    for what, mine, yours in (
        ("groups", tuple(body.groups), tuple(other.groups)),
        ("actuators", names, [each.name for each in actuators_of(other)]),
        ("sensors", model.sensor_adr.tolist(), its.sensor_adr.tolist()),
        ("timestep", model.opt.timestep, its.opt.timestep),
    ):
        check(mine == yours, f"{what} of a body of the batch", yours, f"those of the first, {mine}")


def start_key(body: Body, model: mujoco.MjModel) -> int:
    """The number of the keyframe in which a body starts; −1 for the reference pose of a model without keyframes."""
    names = [model.key(i).name for i in range(model.nkey)]
    start = getattr(body, "start", START)
    if start is None:
        return 0 if names else -1
    check(start in names, "keyframes of the body", names, f"a list with {start!r}")
    return names.index(start)


def start_pose(body: Body, model: mujoco.MjModel) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The generalised positions and velocities, and the activations, with which a body starts."""
    key = start_key(body, model)
    if key < 0:
        return np.array(model.qpos0), np.zeros(model.nv), np.zeros(model.na)
    return np.array(model.key_qpos[key]), np.array(model.key_qvel[key]), np.array(model.key_act[key])


def _rows(rows: Sequence[int] | np.ndarray, seeds: int) -> tuple[np.ndarray, np.ndarray]:
    """Sorted unique row numbers, from row numbers or a mask, and where each stood."""
    rows = np.asarray(rows)
    if rows.dtype == bool:
        check(rows.shape == (seeds,), "rows.shape", rows.shape, f"({seeds},) for a mask")
        rows = np.flatnonzero(rows)
    found, order = np.unique(rows if rows.size else np.zeros(0, np.int64), return_index=True)
    right = np.issubdtype(found.dtype, np.integer) and (not found.size or (found[0] >= 0 and found[-1] < seeds))
    check(right, "rows", rows, f"integers from 0 to {seeds - 1}")
    return found, order
