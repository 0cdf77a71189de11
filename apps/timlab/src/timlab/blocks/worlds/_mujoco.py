"""MuJoCo models and the muscle law as blocks."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's compiled modules carry no type information.)
import dataclasses
import functools
import types
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar, Literal

import jax.numpy as jnp
import mujoco
import numpy as np
from jaxtyping import Array, Float, PyTree
from mujoco import batch as mujoco_batch

from motorgrad._errors import check
from motorgrad._limits import MAX_DIAGRAM_MODEL_CHARACTERS
from motorgrad.bodies import CURVES, Mjcf, tension
from motorgrad.schema import number, static
from timlab.diagram import Block, Host, HostBlock, HostMoment, Moment, Port, Ports, Signals

_WARNING = mujoco.mjtWarning
# MuJoCo silently resets a simulation that raises one of these warnings; only a counter shows it.
_BAD = slice(int(_WARNING.mjWARN_BADQPOS), int(_WARNING.mjWARN_BADCTRL) + 1)
MAX_STEPS_PER_TICK = 100_000
_STAGE = int(mujoco.mjtStage.mjSTAGE_VEL)


class MujocoHost(Host):
    """One row per seed, stepped together by `mujoco.batch`."""

    def __init__(
        self,
        model: mujoco.MjModel,
        seeds: int,
        key: int,
        actuators: Sequence[str],
        sensors: Mapping[str, slice],
        threads: int,
    ):
        self._key = key
        self._actuators = tuple(actuators)
        self._sensors = sensors
        self._timestep = float(model.opt.timestep)
        self._substeps = 0
        self._batch = mujoco_batch.Batch(model, seeds, int(threads), persistent=True)
        self._control = self._batch.bind("ctrl")
        self._bad = self._batch.warning[:, _BAD, 1]
        self._sources = {"sensors": "sensordata", "qpos": "qpos", "qvel": "qvel"}
        self._diverged = np.zeros(seeds, bool)
        self._reset(np.arange(seeds))

    def output(self, block: HostBlock, inputs: dict[str, np.ndarray], now: HostMoment) -> dict[str, np.ndarray]:
        if self._substeps == 0:  # the first call
            self._substeps = steps_in("tick of the block", now.step, self._timestep)
        readings = self._readings
        sensors = {
            name: readings["sensors"][:, part.start] if part.stop - part.start == 1 else readings["sensors"][:, part]
            for name, part in self._sensors.items()
        }
        state = {name: readings[name] for name in ("qpos", "qvel") if readings[name].shape[1]}
        return {**sensors, **state, "diverged": self._diverged}

    def update(self, block: HostBlock, inputs: dict[str, np.ndarray], now: HostMoment) -> None:
        for place, name in enumerate(self._actuators):
            self._control[:, place] = inputs[name]
        failed: Any = []
        try:
            self._batch.step(None, self._substeps, _STAGE)
        except mujoco_batch.SimulationError as error:
            failed = error.ids
        self._diverged = self._bad.any(axis=1)
        self._diverged[failed] = True
        back = np.flatnonzero(self._diverged | np.asarray(inputs["reset"], bool))
        self._read()
        if back.size:
            self._reset(back)

    def snapshot(self) -> dict[str, np.ndarray]:
        readings = {name: value.copy() for name, value in self._readings.items()}
        return {"state": self._batch.state.copy(), "diverged": self._diverged.copy(), **readings}

    def restore(self, snapshot: Mapping[str, np.ndarray]) -> None:
        own = self.snapshot()
        fits = set(snapshot) == set(own) and all(np.shape(snapshot[n]) == own[n].shape for n in own)
        check(fits, "snapshot", sorted(snapshot), "a snapshot of this block with as many seeds")
        np.copyto(self._batch.state, snapshot["state"])
        self._diverged = np.array(snapshot["diverged"], bool)
        # after a restore contact sensors read 0 until the next step, so the readings are part of the snapshot
        self._readings = {name: np.array(snapshot[name]) for name in self._sources}
        self._bad[...] = 0

    def _reset(self, rows: np.ndarray) -> None:
        self._batch.reset(rows, self._key)
        self._bad[rows] = 0
        self._read()

    def _read(self) -> None:
        bound = {name: np.asarray(self._batch.bind(source)) for name, source in self._sources.items()}
        self._readings = {name: value.reshape(len(self._diverged), -1).copy() for name, value in bound.items()}


def steps_in(name: str, length: float, step: float) -> int:
    """The number of simulation steps per tick. **Raises** `ValueError` unless it is whole."""
    steps = round(length / step)
    whole = 1 <= steps <= MAX_STEPS_PER_TICK and abs(length / step - steps) <= 1e-6 * steps
    wanted = f"a whole number of simulation steps of {step:g} s, and at most {MAX_STEPS_PER_TICK}"
    check(whole, name, length, wanted)
    return steps


PENDULUM = """
<mujoco model="pendulum">
  <option timestep="0.002"/>
  <worldbody>
    <body pos="0 0 1">
      <joint name="hinge" axis="0 1 0" damping="0.02"/>
      <geom type="capsule" fromto="0 0 0 0 0 -0.5" size="0.02" mass="0.5"/>
    </body>
  </worldbody>
  <actuator><motor name="torque" joint="hinge" gear="1"/></actuator>
  <sensor><jointpos name="angle" joint="hinge"/><jointvel name="speed" joint="hinge"/></sensor>
</mujoco>
""".strip()


@dataclasses.dataclass(frozen=True)
class MujocoModel(HostBlock):
    """Any MuJoCo model. Every actuator is an input for its control, every sensor an output; unnamed ones are numbered.
    `qpos` and `qvel` are all positions and velocities. Where `reset` is true the model returns to its initial state at
    the next tick; it does so too, with `diverged`, if the simulation diverges.

    Seeds are stepped together, on as many threads as there are processors. A tick of the block is a whole number of the
    model's time steps.
    """

    name: ClassVar[str] = "mujoco model"
    category: ClassVar[str] = "bodies and worlds"

    xml: str = static(PENDULUM, help="the model as MJCF, if there is no file")
    file: str = static(
        "", help="path of an MJCF or URDF file, relative to the working folder, with its meshes beside it"
    )
    keyframe: str = static("", help="name of the initial keyframe; empty for the model's default state")
    muscle_model: Literal["native", "hill"] = static(
        "native", help="native for MuJoCo's own muscles, hill for Hill-type muscles in their place"
    )
    tendon: Literal["compliant", "rigid"] = static("compliant", help="whether the tendons of Hill-type muscles stretch")
    curves: Literal[tuple(CURVES)] = static("de-groote", help="the curves of Hill-type muscles")  # type: ignore[valid-type]

    def validate(self) -> None:
        for taken, names in ((("reset",), self.actuators), (("qpos", "qvel", "diverged"), self.sensors)):
            for name in names:
                check(name not in taken, "name in the model", name, f"different from {', '.join(taken)}")

    @functools.cached_property
    def model(self) -> mujoco.MjModel:
        """The compiled model."""
        return self.body.model

    @functools.cached_property
    def body(self) -> Mjcf:
        """The model as a body, in which every part that has a port has a name."""
        muscles: Any = {"muscle_model": self.muscle_model, "tendon": self.tendon, "curves": self.curves}
        if self.file:
            return Mjcf(Path(self.file), self.keyframe or None, **muscles)
        check(
            len(self.xml) <= MAX_DIAGRAM_MODEL_CHARACTERS,
            "xml",
            f"{len(self.xml)} characters",
            f"at most {MAX_DIAGRAM_MODEL_CHARACTERS} characters",
        )
        check("<" in self.xml, "xml", self.xml, "MJCF as text")
        return Mjcf(self.xml, self.keyframe or None, **muscles)

    @functools.cached_property
    def actuators(self) -> tuple[str, ...]:
        """The names of the actuators."""
        return self.body.groups

    @functools.cached_property
    def sensors(self) -> dict[str, slice]:
        """The slice of each sensor in the array of all sensor readings, by name."""
        found = {}
        for i in range(self.model.nsensor):
            sensor = self.model.sensor(i)
            start = int(sensor.adr[0])
            found[sensor.name] = slice(start, start + int(sensor.dim[0]))
        return found

    @property
    def inputs(self) -> Ports:
        controls = {name: Port(feedthrough=False, default=0.0) for name in self.actuators}
        return {**controls, "reset": Port((), "bool", feedthrough=False, default=0.0)}

    @property
    def outputs(self) -> Ports:
        return self._outputs

    @functools.cached_property
    def _outputs(self) -> Ports:  # read at every tick
        sizes = {name: part.stop - part.start for name, part in self.sensors.items()}
        sensors = {name: Port(() if size == 1 else (size,)) for name, size in sizes.items()}
        state = {name: Port((size,)) for name, size in (("qpos", self.model.nq), ("qvel", self.model.nv)) if size}
        return {
            **sensors,
            **state,
            "diverged": Port((), "bool", help="whether the simulation diverged in the previous tick"),
        }

    def ticks(self, tick: float) -> int:
        ticks = super().ticks(tick)
        steps_in("tick of the block", ticks * tick, self.model.opt.timestep)
        return ticks

    def start(self, seeds: np.ndarray, uniforms: Float[np.ndarray, "seeds 0"], threads: int = 0) -> MujocoHost:
        names = [self.model.key(i).name for i in range(self.model.nkey)]
        key = names.index(self.keyframe) if self.keyframe else -1
        return MujocoHost(self.model, len(seeds), key, self.actuators, self.sensors, threads)

    def __reduce__(self) -> tuple[Any, ...]:  # the compiled model is not pickled
        return _rebuild, (type(self), {field.name: getattr(self, field.name) for field in dataclasses.fields(self)})


def _rebuild(kind: type[MujocoModel], fields: dict[str, Any]) -> MujocoModel:
    return kind(**fields)


# The function that the physics uses, with JAX's NumPy in place of NumPy: the law is written in one place.
_tension = types.FunctionType(tension.__code__, {**tension.__globals__, "np": jnp}, "tension", tension.__defaults__)


@dataclasses.dataclass(frozen=True)
class MuscleLaw(Block):
    r"""Muscle tension, $F = a f_\max \exp(-(L/r - 1)^2/k) + d\,\dot L$ (`motorgrad.bodies.tension`)."""

    name: ClassVar[str] = "muscle"
    category: ClassVar[str] = "bodies and worlds"

    strength: Any = number(100.0, 0, unit="N", help=r"$f_\max$, largest force")
    rest_length: Any = number(0.2, 1e-6, unit="m", help="$r$, length of the largest force")
    curve: Any = number(0.5, 1e-6, help="$k$, width of the force–length curve")
    damping: Any = number(0.0, 0, unit="N s/m", help="damping, $d$")
    shape: tuple[int, ...] = static((), help="shape of the signals")

    def validate(self) -> None:
        for name in ("strength", "rest_length", "curve", "damping"):
            self.check_broadcasts(name, self.shape)

    @property
    def inputs(self) -> Ports:
        return {
            "activation": Port(self.shape, help="from 0 to 1"),
            "length": Port(self.shape, unit="m"),
            "velocity": Port(self.shape, default=0.0, unit="m/s", help="positive while the muscle lengthens"),
        }

    @property
    def outputs(self) -> Ports:
        return {"tension": Port(self.shape, unit="N", help="positive for a pull")}

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        moved = (jnp.clip(inputs["activation"], 0, 1), inputs["length"], inputs["velocity"])
        return {"tension": _tension(*moved, self.strength, self.rest_length, self.curve, self.damping)}
