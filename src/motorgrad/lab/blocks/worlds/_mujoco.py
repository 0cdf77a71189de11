"""Any MuJoCo model as a block, with a port for each actuator and each sensor."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's compiled modules carry no type information.)

import dataclasses
import functools
from typing import Annotated, Any, ClassVar

import mujoco
import numpy as np
from jaxtyping import Float

from motorgrad._errors import check, choice
from motorgrad.lab._block import Ports
from motorgrad.lab._host import HostBlock
from motorgrad.lab._parameter import Setting
from motorgrad.lab._port import Port
from motorgrad.lab.blocks.worlds._mjcf import read_model
from motorgrad.lab.blocks.worlds._mujoco_host import MujocoHost, steps_in

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
    """Any MuJoCo model. Every actuator is an input, of its control, and every sensor an output; those without a name
    are called by their number. `qpos` and `qvel` are all positions and velocities. Where `reset` is true it is back at
    its start at the next tick; so it is, with `diverged`, where the simulation breaks.

    Seeds are stepped together, on as many threads as there are processors. A tick of the block has a whole number
    of the model's time steps.
    """

    name: ClassVar[str] = "mujoco model"
    category: ClassVar[str] = "bodies and worlds"

    xml: Annotated[str, Setting("the model as MJCF, where there is no file")] = PENDULUM
    file: Annotated[str, Setting("an MJCF or URDF file by its path from the working folder; meshes lie beside it")] = ""
    keyframe: Annotated[str, Setting("the name of the keyframe that it starts in; none for the model's own start")] = ""

    def validate(self) -> None:
        for name in ("xml", "file", "keyframe"):
            check(isinstance(getattr(self, name), str), name, getattr(self, name), "a text")
        if self.keyframe:
            choice("keyframe", self.keyframe, [self.model.key(i).name for i in range(self.model.nkey)])
        for taken, names in ((("reset",), self.actuators), (("qpos", "qvel", "diverged"), self.sensors)):
            for name in names:
                check(name not in taken, "name in the model", name, f"another than {', '.join(taken)}")

    @functools.cached_property
    def model(self) -> mujoco.MjModel:
        """The compiled model."""
        return read_model(self.xml, self.file)

    @functools.cached_property
    def actuators(self) -> tuple[str, ...]:
        """The names of its actuators."""
        return tuple(self.model.actuator(i).name or f"actuator {i + 1}" for i in range(self.model.nu))

    @functools.cached_property
    def sensors(self) -> dict[str, slice]:
        """Where each sensor is among all sensors' numbers, by name."""
        found = {}
        for i in range(self.model.nsensor):
            sensor = self.model.sensor(i)
            start = int(sensor.adr[0])
            found[sensor.name or f"sensor {i + 1}"] = slice(start, start + int(sensor.dim[0]))
        return found

    @property
    def inputs(self) -> Ports:
        controls = {name: Port(feedthrough=False, default=0.0) for name in self.actuators}
        return {**controls, "reset": Port((), "bool", feedthrough=False, default=0.0)}

    @property
    def outputs(self) -> Ports:
        return self._outputs

    @functools.cached_property
    def _outputs(self) -> Ports:  # asked for at every tick
        sizes = {name: part.stop - part.start for name, part in self.sensors.items()}
        sensors = {name: Port(() if size == 1 else (size,)) for name, size in sizes.items()}
        state = {name: Port((size,)) for name, size in (("qpos", self.model.nq), ("qvel", self.model.nv)) if size}
        return {**sensors, **state, "diverged": Port((), "bool", help="whether it broke in the tick before")}

    def ticks(self, tick: float) -> int:
        ticks = super().ticks(tick)
        steps_in("tick of the block", ticks * tick, self.model.opt.timestep)
        return ticks

    def start(self, seeds: np.ndarray, uniforms: Float[np.ndarray, "seeds 0"], threads: int = 0) -> MujocoHost:
        names = [self.model.key(i).name for i in range(self.model.nkey)]
        key = names.index(self.keyframe) if self.keyframe else -1
        return MujocoHost(self.model, len(seeds), key, self.actuators, self.sensors, threads)

    def __reduce__(self) -> tuple[Any, ...]:  # the compiled model stays behind
        return _again, (type(self), {field.name: getattr(self, field.name) for field in dataclasses.fields(self)})


def _again(kind: type[MujocoModel], fields: dict[str, Any]) -> MujocoModel:
    return kind(**fields)
