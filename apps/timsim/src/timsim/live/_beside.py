"""Bodies beside the one that learns: other policies on the same task, which do not learn."""

from __future__ import annotations

import dataclasses
import hashlib
import inspect
import io
import json
import numbers
import zipfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, cast

import jax
import jax.numpy as jnp
import numpy as np

from motorgrad._consent import is_allowed
from motorgrad._errors import NotTrusted, check, check_integer
from motorgrad._extras import require
from motorgrad._files import read_content
from motorgrad._limits import MAX_ARRAY_BYTES
from motorgrad.learning import Agent, Learner
from motorgrad.policies import Policy
from motorgrad.tasks import Task
from motorgrad.training import Run, load, stepper_for
from timsim.live._policy import load_policy
from timsim.live._probe import Probed, probe
from timsim.live._snapshot import MAX_BODIES, MAX_LABEL_CHARACTERS

UNTRAINED = "untrained"
MAX_COMPARED_POLICIES = MAX_BODIES - 3
"""Policies beside a learner; there is room for an untrained body and another branch."""


@dataclasses.dataclass(frozen=True, eq=False)
class Beside:
    """A policy that moves its own body beside the one that learns.

    **Arguments:** `label`: what stands above the body; `agent`: whose policy acts; `seed` of its random numbers;
    `initial`: its policy along a leading axis of one, by default the agent's; `memory`: what the task remembers from
    when that policy was learned; `predict`: chooses the actions in place of the agent, `predict(observation)`.
    """

    label: str
    agent: Learner
    seed: int = 0
    initial: Policy | None = None
    memory: Any = None
    predict: Any = None


class BesideBody:
    """The body of a `Beside` in an engine of its own."""

    def __init__(self, task: Task, what: Beside, feet: list[str]):
        self.label, self._task, self._predict = what.label, task, what.predict
        mode = "sample" if what.predict is None else "given"
        self.stepper = stepper_for(task, what.agent, [what.seed], mode, threads=1, initial=what.initial)
        if what.memory is not None:
            self.stepper.set_policies(self.stepper.policies(), what.memory)
        self._probe = probe(self.stepper, feet)
        self._recurrent: Any = None
        # the observation as the environment gives it, in its own units; a task that scales draws no numbers to observe
        scales = task.observation_code.scales
        self._raw = self.stepper.viewer(
            lambda cycle, state: (
                task.sense(cycle.memory, state, jnp.zeros(task.uniforms))[1] if scales else cycle.observation
            )
        )
        if self._predict is not None:
            self._deterministic = "deterministic" in _parameters(self._predict)
            self._choose()
        self.start = self.state

    def advance(self, ticks: int) -> None:
        """Make decisions."""
        if self._predict is None:
            self.stepper.advance(ticks)
            return
        for _ in range(ticks):
            self.stepper.advance(1)
            self._choose()

    def observe(self) -> Probed:
        """The present moment. Of a policy that is not motorgrad's, neither parameters nor probabilities are known."""
        found = self._probe()
        if self._predict is not None:
            unknown = ("parameters", "fixed", "probability", "baseline")
            found |= {name: np.full_like(found[name], np.nan) for name in unknown}
        return found

    @property
    def state(self) -> Any:
        """A copy of everything that determines the future."""
        return {"engine": self.stepper.state, "recurrent": self._recurrent}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Restore a state."""
        self.stepper.restore(state["engine"])
        self._recurrent = state["recurrent"]

    def _choose(self) -> None:
        """Ask for the next action."""
        settings: dict[str, Any] = {"deterministic": True} if self._deterministic else {}
        if self._recurrent is not None:
            settings["state"] = self._recurrent
        code = self._task.interface().actions
        seen = self._task.observation_code
        found = self._predict(self._raw()[0].astype(np.float32).reshape(seen.shape), **settings)
        if isinstance(found, tuple):  # stable-baselines3 returns the state of recurrent policies, too
            found, self._recurrent = found
        action = code.of_raw(found, f"action of {self.label!r}")
        self.stepper.set_actions(action.reshape(1, *([] if action.size == 1 else [action.size])))


def fitted(rows: np.ndarray, like: np.ndarray) -> np.ndarray:
    """Rows of a given width: longer ones are cut, shorter ones are filled with NaN."""
    if rows.shape[1:] == like.shape[1:]:
        return rows
    wide = np.full((len(rows), *like.shape[1:]), np.nan)
    width = min(rows.shape[1], like.shape[1])
    wide[:, :width] = rows[:, :width]
    return wide


def side_by_side(
    run: Run | Path | str | None, seeds: int | Sequence[int], beside: Mapping[str, Any] | None = None
) -> tuple[int, str, dict[str, Any] | None]:
    """What `setup_of` is given for one seed, or for several of a run.

    **Returns** the first seed; its label, "" where there is only one; and the bodies `beside`, with the other seeds.

    **Raises** `ValueError` for several seeds without a run, and for a seed that is given twice.
    """
    if isinstance(seeds, numbers.Integral):
        check_integer("seed", seeds, 0)
        return int(seeds), "", None if beside is None else dict(beside)
    chosen = list(cast(Sequence[int], seeds))
    for seed in chosen:
        check_integer("seed", seed, 0)
    check(len(chosen) == len(set(chosen)) > 0, "seed", chosen, "an integer, or several different ones")
    check(len(chosen) == 1 or run is not None, "seed", chosen, "one seed: several are shown side by side of a run")
    others = {f"seed {seed}": (run, seed) for seed in chosen[1:]} | dict(beside or {})
    return chosen[0], f"seed {chosen[0]}" if len(chosen) > 1 else "", others or None


def beside_of(
    task: Task, agent: Learner, given: Mapping[str, Any], seed: int, trust: bool = False
) -> tuple[Beside, ...]:
    """The bodies that `setup_of` is asked for, by label.

    **Arguments:** `given`: by label, a run, its directory, or a pair of one and a seed; a policy, or a file of one
    (.npz); a model of stable-baselines3, or a file of one (.zip); a function `predict(observation)`, or anything with a
    method of that name; or `"untrained"`. `trust`: whether files of stable-baselines3 may be loaded, which runs code.

    **Raises** `ValueError` for anything else, and for a policy that does not fit the task; `NotTrusted` for a file of
    stable-baselines3 without `trust`.
    """
    check(
        len(given) <= MAX_COMPARED_POLICIES, "number of policies beside", len(given), f"at most {MAX_COMPARED_POLICIES}"
    )
    found = []
    for label, what in given.items():
        fine = isinstance(label, str) and 0 < len(label) <= MAX_LABEL_CHARACTERS
        check(fine, "label in beside", label, f"a text of at most {MAX_LABEL_CHARACTERS} characters")
        try:
            found.append(_beside(task, agent, label, what, seed, trust))
        except ValueError as error:
            raise ValueError(f"beside {label!r}: {error}") from None
    return tuple(found)


def _beside(task: Task, agent: Learner, label: str, given: Any, seed: int, trust: bool) -> Beside:
    pair: Any = given if isinstance(given, tuple) and len(given) == 2 else (given, None)
    what, of = pair
    if isinstance(what, str) and what == UNTRAINED:
        return Beside(label, agent, seed)
    if isinstance(what, Policy):
        return Beside(label, Agent(what), seed)
    if isinstance(what, str | Path):
        path = Path(what)
        if path.suffix == ".zip":
            return Beside(label, agent, seed, predict=load_stable_baselines(path, trust).predict)
        if path.suffix == ".npz":
            shape = jax.eval_shape(agent.init, jax.random.key(0)).policy
            return Beside(label, agent, seed, *load_policy(path, shape, task.name))
        check(path.is_dir(), "path", str(path), "a run directory, a saved policy (.npz), or a model (.zip)")
        what = load(path)
    if isinstance(what, Run):
        name = what.config["task"]["name"]
        check(name == task.name, "task of the run", name, repr(task.name))
        of = what.seeds[0] if of is None else of
        memory = what.memory
        row = what.seeds.index(of) if of in what.seeds else 0
        memory = None if memory is None else jax.tree.map(lambda leaf: leaf[row : row + 1], memory)
        return Beside(label, Agent(what.policy(of)), of, memory=memory)
    if hasattr(what, "predict"):
        # a model of stable-baselines3 holds environments, which cannot be sent to the worker's process; its policy can
        policy = getattr(what, "policy", what)
        return Beside(label, agent, seed, predict=(policy if hasattr(policy, "predict") else what).predict)
    if callable(what):
        return Beside(label, agent, seed, predict=what)
    allowed = "a run, a policy, a path of one, a model with `predict`, or a function of the observation"
    check(False, "policy", what, allowed)
    raise AssertionError


def load_stable_baselines(path: Path, trust: bool = False) -> Any:
    """The policy of a model saved by stable-baselines3, whatever its algorithm.

    **Raises** `NotTrusted` without `trust`: the file is pickled, so that loading it runs what it holds. `ValueError`
    for another file.
    """
    check(path.is_file(), "path", str(path), "a file that exists")
    content = read_content(path, MAX_ARRAY_BYTES)
    name = f"stable-baselines3:{hashlib.sha256(content).hexdigest()}"  # what was asked for is what is run
    if not (trust or is_allowed(name)):  # asked here, where it is loaded, so that no spelling leads around it
        raise NotTrusted(
            f"{path} is a model of stable-baselines3: loading it runs code that it holds; nothing was loaded. If you "
            "trust it: trust=True in Python, --trust on the command line",
            [name],
        )
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as packed:
            json.loads(packed.read("data"))
    except (KeyError, ValueError, zipfile.BadZipFile) as error:
        raise ValueError(f"{path}: not a model of stable-baselines3: {error}") from None
    require("a model of stable-baselines3 needs", "stable_baselines3", "peers")
    from stable_baselines3.common.policies import ActorCriticPolicy  # pyright: ignore[reportMissingImports]
    from stable_baselines3.common.save_util import load_from_zip_file  # pyright: ignore[reportMissingImports]

    data, parameters, _ = load_from_zip_file(io.BytesIO(content), device="cpu")
    assert data is not None
    kind = data["policy_class"]
    settings = dict(data.get("policy_kwargs") or {})
    if issubclass(kind, ActorCriticPolicy):
        settings["use_sde"] = data.get("use_sde", False)
    policy = kind(data["observation_space"], data["action_space"], lambda _: 0.0, **settings)
    weights: Any = parameters["policy"]
    policy.load_state_dict(weights)
    policy.set_training_mode(False)
    return policy


def _parameters(function: Callable[..., Any]) -> Mapping[str, Any]:
    try:
        return inspect.signature(function).parameters
    except (TypeError, ValueError):  # written in C
        return {}
