"""Tasks on bodies, and Gymnasium environments, as blocks on the host."""

import dataclasses
import functools
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, cast

import numpy as np
from jaxtyping import Float

from motorgrad._errors import check
from motorgrad.lab._block import Ports
from motorgrad.lab._host import HostBlock
from motorgrad.lab._parameter import Setting
from motorgrad.lab.blocks._toml import as_text, read_table
from motorgrad.lab.blocks.worlds._scene import action_port, scene_ports
from motorgrad.lab.blocks.worlds._task_host import Functions, TaskHost, functions
from motorgrad.tasks import TASKS, BodyTask, Gymnasium, HostTask, make

BODIES = tuple(name for name, kind in TASKS.items() if issubclass(kind, BodyTask))


@dataclasses.dataclass(frozen=True)
class HostTaskBlock(HostBlock):
    """What the two have in common: ports and functions of a task on the host."""

    category: ClassVar[str] = "bodies and worlds"

    @functools.cached_property
    def made(self) -> HostTask:
        """The task."""
        raise NotImplementedError

    @functools.cached_property
    def _compiled(self) -> Functions:
        return functions(self.made, self.made.batch([0], threads=1).unpack)

    @property
    def inputs(self) -> Ports:
        return {"action": action_port(self.made)}

    @property
    def outputs(self) -> Ports:
        return self._outputs

    @functools.cached_property
    def _outputs(self) -> Ports:  # asked for at every tick
        return scene_ports(self.made)

    @property
    def uniforms(self) -> int:
        return self.made.init_uniforms + 2 * self.made.uniforms

    @property
    def init_uniforms(self) -> int:
        return self.made.init_uniforms + self.made.uniforms

    @property
    def no_restore(self) -> str | None:
        return self.made.no_resume

    def start(self, seeds: np.ndarray, uniforms: Float[np.ndarray, "seeds _"], threads: int = 0) -> TaskHost:
        batch = self.made.batch([int(seed) for seed in seeds], threads)
        return TaskHost(self.made, batch, self._compiled, uniforms)


@dataclasses.dataclass(frozen=True)
class Body(HostTaskBlock):
    """A task on a body of muscles: the hopper, the hexapods. All seeds are stepped together, on as many threads as
    there are processors.

    It shows an observation; the action on it moves the body until the next tick, which then shows what was paid. A tick
    of the block is a decision, and as long as the task's `period`.
    """

    name: ClassVar[str] = "body"

    task: Annotated[str, Setting("its name", choices=BODIES)] = "hopper"
    settings: Annotated[str | Mapping[str, Any], Setting("the task's settings, as TOML: `penalty = 0.2`")] = ""

    def validate(self) -> None:
        object.__setattr__(self, "settings", as_text("settings", self.settings))
        _ = self.made

    @functools.cached_property
    def made(self) -> BodyTask:
        return cast(BodyTask, make(self.task, **read_table("settings", self.settings)))

    def ticks(self, tick: float) -> int:
        ticks, period = super().ticks(tick), self.made.period
        fits = abs(ticks * tick - period) <= 1e-6 * period
        check(fits, "tick of the block", ticks * tick, f"a decision of the task, {period:g} s")
        return ticks


@dataclasses.dataclass(frozen=True)
class Environment(HostTaskBlock):
    """Any Gymnasium environment that is installed, one for each seed; observations are scaled and actions coded as
    `motorgrad.tasks.Gymnasium` does.

    It is made by Gymnasium, from what is registered there: an id may not name a module to import. Some environments
    cannot be saved: then a run of the diagram cannot go back, and says so before it runs.
    """

    name: ClassVar[str] = "environment"

    env_id: Annotated[str, Setting("the environment's id")] = "CartPole-v1"
    settings: Annotated[
        str | Mapping[str, Any],
        Setting("settings of the task, as TOML; the environment's own are `kwargs.name = 1`"),
    ] = ""

    def validate(self) -> None:
        object.__setattr__(self, "settings", as_text("settings", self.settings))
        text = isinstance(self.env_id, str) and len(self.env_id) <= 200 and ":" not in self.env_id
        check(text, "env_id", self.env_id, "the id of a registered environment; import its module yourself")
        _ = self.made

    @functools.cached_property
    def made(self) -> HostTask:
        return cast(Gymnasium, make("gymnasium", env_id=self.env_id, **read_table("settings", self.settings)))
