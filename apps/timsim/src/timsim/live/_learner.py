"""A learner that can be watched and changed while it runs."""

import dataclasses
import warnings
from collections.abc import Callable, Mapping
from typing import Any

import jax
import numpy as np
from jaxtyping import PyTree

from motorgrad import learning
from motorgrad._errors import check
from motorgrad.policies import Policy, abilities, with_interface
from motorgrad.tasks import EnvironmentPictures, Task
from motorgrad.training import RunWarning, Stepper, interface_of, stepper_for
from motorgrad.training.engines import Mode, Record, mean_reward, without_broken
from timsim.live._beside import UNTRAINED, Beside, BesideBody, fitted
from timsim.live._foreign import Picture, body_in, picture_of
from timsim.live._kept import Kept
from timsim.live._numbers import check_number
from timsim.live._policy import load_policy, save_policy
from timsim.live._probe import Probed, gradient_norm, probe
from timsim.live._replies import Ready
from timsim.live._settings import AGENT, TASK, agent_numbers, task_numbers
from timsim.live._setup import Setup
from timsim.live._snapshot import Sample, Sizes, Tally

ROOM = 20.0  # simulated seconds of the trail
MAX_KEPT_ENGINES = 4  # so that going back to a setting makes nothing anew
EXPLORATION = "exploration"


class Learner:
    """One seed of a task's learner, in the engine of training; and the bodies beside it, which do not learn."""

    horizon = 0

    def __init__(self, setup: Setup):
        assert setup.task is not None
        assert setup.agent is not None
        self._setup, self.task, self.agent = setup, setup.task, setup.agent
        self.frozen = setup.frozen
        self.diverged = 0
        self._changes: dict[str, float] = {}
        self._engines: dict[Any, Stepper] = {}
        self._probes: dict[Stepper, Any] = {}
        self._body = body_in(stepper := self._engine())
        self._pictures = EnvironmentPictures()
        if setup.memory is not None:
            stepper.set_policies(stepper.policies(), setup.memory)
        self._stepper = stepper
        self._bodies = {each.label: BesideBody(self.task, each, self._body.feet) for each in setup.beside}
        self._beside = list(self._bodies)
        self.settings = agent_numbers(self.agent) | task_numbers(self.task) | self._body.read()
        if abilities.has_temperature(stepper.policy):
            self.settings[EXPLORATION] = 1.0
        self._pushed_until = self._counted = 0
        self._last: Probed | None = None
        self._kept: Kept | None = None  # while frozen, unless it was from the start
        self._start = self.state

    @property
    def tick(self) -> int:
        return self._stepper.decision

    @property
    def period(self) -> float:
        return self.task.period

    @property
    def labels(self) -> list[str]:
        return [self._setup.label, *self._beside]

    def about(self) -> Ready:
        width = {name: array.shape[1] for name, array in self._probe_learner().items() if array.ndim == 2}
        body = self._body
        metrics = list(self.task.metric_names)
        units = width["probability"]
        room = int(np.clip(ROOM / self.period, 200, 4000))
        moved = (width["position"], width["velocity"], width["activation"], len(body.muscles))
        learned = (width["observation"], units, width["parameters"])
        remembered = (width["marks"], width["memory"], width["fixed"])
        sizes = Sizes(*moved, *learned, len(body.feet), room, len(metrics), *remembered)
        inputs = list(self.task.observation_names)
        named = [getattr(self.task, "action_names", ()), body.groups, [f"unit {i}" for i in range(units)]]
        actions = next(list(names) for names in named if len(names) == units)
        return Ready(sizes, self.period, self.settings, inputs, actions, body.muscles, body.feet, metrics)

    def advance(self, ticks: int) -> None:
        """Make decisions; a push ends between two of them."""
        while ticks > 0:
            left = self._pushed_until - self.tick
            count = min(ticks, left) if left > 0 else ticks
            self._stepper.advance(count)
            for each in self._shown:
                each.advance(count)
            ticks -= count
            if left > 0 and self.tick == self._pushed_until:
                self._body.release(self._stepper)
        self._last = None

    def step(self) -> Sample:
        before = self._probe_bodies() if self._last is None else self._last
        self.advance(1)
        return self._make_sample(before)

    def sample(self) -> Sample:
        return self._make_sample(None)

    def tally(self) -> list[Tally]:
        count = self.tick - self._counted
        record = self._stepper.harvest()
        self._counted = self.tick
        self._last = None
        self.diverged += int(record["diverged"][0]) if "diverged" in record else 0
        return [self._tallied(record, count), *(self._tallied(each.stepper.harvest(), count) for each in self._shown)]

    def _tallied(self, record: Record, count: int) -> Tally:
        """What an engine recorded over a number of decisions."""
        names = self.task.metric_names
        record = without_broken(record)
        lost = int(record["diverged"][0]) if "diverged" in record else 0
        values = np.array([mean_reward(record, count)[0], *(record[name][0] for name in names)], float)
        counts = np.array([count - lost, *(record[f"{name}_count"][0] for name in names)], float)
        return Tally(values, np.where(np.isfinite(values), counts, 0.0))

    @property
    def state(self) -> Any:
        return {
            "learner": self._stepper.state,
            "beside": {each.label: each.state for each in self._shown},
            "frozen": self.frozen,
            "kept": self._kept,
            "changes": dict(self._changes),
            "settings": dict(self.settings),
            "pushed": self._pushed_until,
            "counted": self._counted,
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        self.frozen = state["frozen"]
        self._kept = state["kept"]
        self._changes = dict(state["changes"])
        self._stepper = self._engine()
        self.settings = dict(state["settings"])
        self._pushed_until = state["pushed"]
        self._counted = state["counted"]
        self._last = None
        self._body.apply(self.settings, self._all)
        self._stepper.restore(state["learner"])
        self._beside = list(state["beside"])
        for label, each in state["beside"].items():
            self._body_beside(label).restore(each)

    def begin_again(self) -> None:
        settings = {name: value for name, value in self.settings.items() if name != EXPLORATION}
        frozen = self.frozen
        kept = {"changes": self._changes, "settings": {**self._start["settings"], **settings}}
        self.restore({**self._start, **kept, "beside": {each.label: each.start for each in self._shown}})
        if frozen != self.frozen:
            self._switch(self._changes, frozen)
        for name in agent_numbers(self.agent):
            self._stepper.set_number(name.removeprefix(AGENT), settings[name])

    def edit(self, name: str, value: float) -> None:
        value = float(value)
        if name in self._body.numbers:
            check_number(name, self._body.numbers[name], value, self.period)
            self._body.apply({**self.settings, name: value}, self._all)
        elif name.startswith(TASK):
            self._switch({**self._changes, name.removeprefix(TASK): value}, self.frozen)
        elif name == EXPLORATION:
            check(value > 0, name, value, "above 0")
            factor = value / self.settings[EXPLORATION]

            def explore(state: dict[str, Any]) -> None:
                cycle = state["cycle"]
                policy = jax.tree.map(np.asarray, abilities.with_temperature(cycle.agent.policy, factor))
                state["cycle"] = cycle._replace(agent=cycle.agent._replace(policy=policy))
                if self._kept is not None:
                    self._kept = self._kept._replace(agent=self._kept.agent._replace(policy=policy))

            self._change_state(explore)
        else:
            path = name.removeprefix(AGENT)
            try:
                self._stepper.set_number(path, value)
            except ValueError as error:
                raise ValueError(f"{AGENT}{error}" if str(error).startswith(path) else str(error)) from None
            self._last = None
        self.settings[name] = value

    def freeze(self, on: bool) -> None:
        if on != self.frozen:
            known = not isinstance(self.agent, learning.SparseLearner)
            check(known, "freeze", on, "left alone with a learner whose units are indexed")
            self._switch(self._changes, on)

    def push(self, body: str, force: tuple[float, float, float], seconds: float) -> None:
        self._body.release(self._stepper)
        self._body.push(body, force, self._stepper)
        self._pushed_until = self.tick + max(1, round(seconds / self.period))

    def compare(self, on: bool) -> None:
        if on and UNTRAINED not in self._beside:
            untrained = self._body_beside(UNTRAINED)
            untrained.restore(untrained.start)
        self._beside = [label for label in self._beside if label != UNTRAINED] + on * [UNTRAINED]
        self._last = None

    def save(self, path: str) -> None:
        policies = self._stepper.policies()
        interface = interface_of(self.task, self._stepper.policy)
        if interface is not None:
            memory = self._stepper.viewer(lambda cycle, state: cycle.memory)()
            policies = with_interface(policies, interface.with_statistics(self.task.statistics(memory)))
        policy = jax.tree.map(lambda leaf: leaf[0], policies)
        save_policy(path, policy, self.task.name)

    def read_policy(self, path: str, seed: int | None) -> tuple[Any, Any]:
        return load_policy(path, self._stepper.policy, self.task.name, seed)

    def set_policy(self, policy: Policy, memory: PyTree) -> None:
        if memory is None and policy.interface is None and self.task.observation_code.running.any():
            warnings.warn(
                "the policy comes without the running statistics of its observations, which it now sees by the present "
                "ones: save it again with this version",
                RunWarning,
                stacklevel=2,
            )
        self._stepper.set_policies(policy, memory)
        if self._kept is not None:
            self._kept = self._kept.with_policy(self.agent, policy)
        self._last = None
        if EXPLORATION in self.settings:
            self.settings[EXPLORATION] = 1.0

    def control(self, actuator: int, value: float) -> None:
        raise ValueError("control: the learner moves this body")

    def picture(self) -> Picture:
        return picture_of(self._pictures, self._stepper)

    @property
    def _shown(self) -> list[BesideBody]:
        """The bodies beside the learner."""
        return [self._bodies[label] for label in self._beside]

    @property
    def _all(self) -> list[Stepper]:
        return [*self._engines.values(), *(each.stepper for each in self._bodies.values())]

    def _switch(self, changes: dict[str, float], frozen: bool) -> None:
        """Continue from the same state with other settings; if an engine refuses them, keep the old ones."""
        before = (self._changes, self.frozen)
        state = self._stepper.state
        kept = self._kept
        self._changes, self.frozen = changes, frozen
        try:
            stepper = self._engine()
            self._body.apply(self.settings, [stepper])
            if frozen and not before[1]:
                kept = Kept.of(self._stepper)
                state["cycle"] = kept.frozen(state["cycle"], stepper.state["cycle"].agent)
            elif before[1] and not frozen:
                kept = kept or self._kept_at_start(state["cycle"].agent.policy)
                state["cycle"] = kept.thawed(state["cycle"])
                kept = None
            stepper.restore(state)
        except ValueError:
            self._changes, self.frozen = before
            raise
        self._stepper = stepper
        self._kept = kept
        self._last = None

    def _engine(self) -> Stepper:
        """The engine for the present settings."""
        key = (self.frozen, *sorted(self._changes.items()))
        if key not in self._engines:
            try:
                task: Any = dataclasses.replace(self.task, **self._changes) if self._changes else self.task  # type: ignore[type-var]
            except ValueError as error:
                raise ValueError(f"{TASK}{error}") from None
            made = self._made(task, "sample" if self.frozen else "learn")
            while len(self._engines) >= MAX_KEPT_ENGINES:
                old = self._engines.pop(next(iter(self._engines)))
                self._probes.pop(old, None)
            self._engines[key] = made
        self._engines[key] = self._engines.pop(key)  # the newest last
        return self._engines[key]

    def _made(self, task: Task, mode: Mode) -> Stepper:
        return stepper_for(task, self.agent, [self._setup.seed], mode, threads=1, initial=self._setup.initial)

    def _kept_at_start(self, policy: Policy) -> Kept:
        """What a learner knows that was frozen from the start, with the present policy."""
        return Kept.of(self._made(self.task, "learn")).with_policy(self.agent, policy)

    def _body_beside(self, label: str) -> BesideBody:
        """The body of a label; the untrained one is made when it is first needed."""
        if label not in self._bodies:
            untrained = Beside(label, self.agent, self._setup.seed)
            self._bodies[label] = BesideBody(self.task, untrained, self._body.feet)
            self._body.apply(self.settings, [self._bodies[label].stepper])
        return self._bodies[label]

    def _change_state(self, change: Callable[[dict[str, Any]], None]) -> None:
        state = self._stepper.state
        change(state)
        self._stepper.restore(state)
        self._last = None

    def _probe_learner(self) -> Probed:
        """The learner's current body."""
        stepper = self._stepper
        if stepper not in self._probes:
            self._probes[stepper] = probe(stepper, self._body.feet)
        level = {} if self._kept is None else {"baseline": self._kept.baseline}
        return self._probes[stepper]() | level | self._of_body(stepper)

    def _of_body(self, stepper: Stepper) -> Probed:
        """The current readings of the body."""
        return self._body.seen(stepper) | {"control": self._body.control(stepper)}

    def _probe_bodies(self) -> Probed:
        """The current state of every body in view, one per row."""
        found = self._probe_learner()
        if not self._beside:
            return found
        others = [each.observe() | self._of_body(each.stepper) for each in self._shown]
        below = {name: [fitted(each[name], rows) for each in others] for name, rows in found.items()}
        return {name: np.concatenate([rows, *below[name]]) for name, rows in found.items()}

    def _make_sample(self, before: Probed | None) -> Sample:
        after = self._last = self._probe_bodies()
        sample = {name: after[name] for name in after if name not in ("reward_sum", "rates", "batch")}
        unknown = np.full(len(after["position"]), np.nan)
        known = before is not None and len(before["reward_sum"]) == len(after["reward_sum"])
        sample["reward"] = (
            (after["reward_sum"].astype(float) - before["reward_sum"]).sum(axis=1) if known and before else unknown
        )
        sample["gradient_norm"] = gradient_norm(before, after) if known and before else unknown
        return sample
