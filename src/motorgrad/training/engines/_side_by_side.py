"""Several engines for one training, side by side."""

import math
import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

import jax
import numpy as np
from jaxtyping import Float, PyTree

from motorgrad.learning import Learner
from motorgrad.policies import Policy
from motorgrad.tasks import BodyTask
from motorgrad.training.engines._host import BodyStepper
from motorgrad.training.engines._stepper import Record, Stepper, View, fits

MAX_SEEDS_PER_ENGINE = 8
"""Seeds of one engine. With fewer, each costs more, because a compiled call has a price of its own; with more, there
are fewer engines for the other threads."""

T = TypeVar("T")


class SideBySide(Stepper):
    """Learning in a body, with the seeds shared out to engines (`BodyStepper`) that do not wait for each other.

    Within one engine, physics and learners wait for each other at every decision, and threads share physics alone. So
    many seeds are learned in several engines, a thread for each; only their learners take turns. The shares depend on
    the number of seeds alone, so results are the same in every bit for any number of threads.
    """

    def __init__(
        self,
        task: BodyTask,
        agent: Learner,
        seeds: Sequence[int],
        threads: int = 0,
        initial: Policy | None = None,
        numbers: Mapping[str, Any] | None = None,
        envs: int = 1,
    ):
        super().__init__(task, agent, seeds, "learn", initial, numbers)
        threads = threads or os.cpu_count() or 1
        doublings = math.ceil(math.log2(len(self.seeds) / MAX_SEEDS_PER_ENGINE))
        count = 2 ** max(0, doublings)  # which as many threads divide evenly
        shares = np.array_split(np.arange(len(self.seeds)), count)
        self._ends = [int(share[-1]) + 1 for share in shares[:-1]]
        self._threads = min(threads, count)
        self.engines: list[BodyStepper] = []
        for share in shares:
            own = jax.tree.map(lambda leaf, share=share: leaf[share], initial)
            part = {path: np.broadcast_to(values, len(self.seeds))[share] for path, values in (numbers or {}).items()}
            each = max(1, threads // count)
            chosen = self.seeds[share].tolist()
            more: dict[str, Any] = {"room": len(shares[0]), "envs": envs}
            self.engines.append(BodyStepper(task, agent, chosen, "learn", each, own, part, **more))
        self.cycle = self.engines[0].cycle

    def advance(self, decisions: int) -> None:
        with ThreadPoolExecutor(self._threads) as pool:
            for _ in pool.map(lambda engine: engine.advance(decisions), self.engines):
                pass  # an exception of one is raised here, once the others are done
        self.decision += decisions

    @property
    def state(self) -> PyTree[np.ndarray]:
        return self._joined([engine.state for engine in self.engines])

    def restore(self, state: PyTree[np.ndarray]) -> None:
        fits(state, self.state)
        for engine, part in zip(self.engines, self._parted({**state, "decision": None}), strict=True):
            engine.restore({**part, "decision": state["decision"]})
        self.decision = int(state["decision"])

    def harvest(self) -> Record:
        return self._joined([engine.harvest() for engine in self.engines])

    def policies(self) -> Policy:
        return self._joined([engine.policies() for engine in self.engines])

    def set_policies(self, policies: Policy, memory: PyTree = None) -> None:
        parts = zip(self.engines, self._parted(policies), self._parted(memory), strict=True)
        for engine, policy, remembered in parts:
            engine.set_policies(policy, remembered)

    def set_actions(self, actions: np.ndarray) -> None:
        for engine, part in zip(self.engines, np.split(np.asarray(actions), self._ends), strict=True):
            engine.set_actions(part)

    def viewer(self, view: View) -> Callable[[], PyTree[np.ndarray]]:
        views = [engine.viewer(view) for engine in self.engines]
        return lambda: self._joined([viewed() for viewed in views])

    def _put_number(self, place: int, value: float) -> None:
        for engine in self.engines:
            engine.agent = self.agent
            engine._put_number(place, value)

    @property
    def control(self) -> Float[np.ndarray, "seeds groups"]:
        """The present actions, as of `BodyStepper`."""
        return np.concatenate([engine.control for engine in self.engines])

    def _joined(self, parts: list[T]) -> T:
        def join(*leaves: np.ndarray) -> Any:
            return np.concatenate(leaves) if np.ndim(leaves[0]) else leaves[0]  # the number of decisions is one for all

        return jax.tree.map(join, *parts)

    def _parted(self, tree: T) -> list[T]:
        leaves, structure = jax.tree.flatten(tree)
        parts = [np.split(np.asarray(leaf), self._ends) for leaf in leaves]
        return [jax.tree.unflatten(structure, part) for part in zip(*parts, strict=True)] or [tree] * len(self.engines)
