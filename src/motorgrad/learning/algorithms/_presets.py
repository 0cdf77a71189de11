"""Presets: a learner for any task as one table of settings, by name; and what several of their tables share."""

import functools
import json
from collections.abc import Callable, Mapping, Sequence
from importlib.resources import files
from typing import Any, NamedTuple, Protocol

STEPS = 100_000
"""Decisions per seed of a training, unless said otherwise."""
FEATURES = {"nonlinear": 128}
"""What policy and critic see beside their inputs."""
POLICIES: dict[str | tuple[str, ...], dict[str, Any]] = {
    "binary": {"kind": "hyperplanes", "features": FEATURES},
    "discrete": {"kind": "softmax", "features": FEATURES},
    "continuous": {"kind": "bounded-hyperplanes", "density": "squashed", "deviation": 1.5, "features": FEATURES},
    "mixed": {"kind": "mixed", "density": "squashed", "deviation": 1.5, "features": FEATURES},
}
"""The policy for a task's kind of actions."""
PolicyTable = str | Mapping[str, Any]
"""An initial policy by the name of its kind, or as a table with its settings."""


class Learnable(Protocol):
    """The attributes of a task (`motorgrad.tasks.Task`) with which its learner goes."""

    @property
    def actions(self) -> str | tuple[str, ...]: ...
    @property
    def observation_size(self) -> int: ...
    @property
    def action_size(self) -> int: ...
    @property
    def action_range(self) -> Sequence[tuple[float, float]]: ...
    @property
    def longest_episode(self) -> int | None: ...
    @property
    def goal(self) -> object: ...


Table = Callable[[Learnable, int, PolicyTable | None], dict[str, Any]]
"""A learner as a table of settings: for a task, the decisions of a training, and the task's own policy or `None`."""
PRESETS: dict[str, Table] = {}
"""The presets by name, as `preset` registers them."""
PURPOSES: dict[str, str] = {}
"""What each preset is for, by its name."""
SMALL = {"hidden": [64, 64], "activation": "tanh", "layer_norm": False, "sparsity": 0.0, "standardise": True}
"""Hidden layers of policy and critic of batch methods."""
DISCOUNT = 0.99
"""Of the critics with hidden layers, and of the sum by which their rewards are scaled."""


def preset(name: str, purpose: str = "") -> Callable[[Table], Table]:
    """A decorator that registers a table as the preset of this name, with what it is for in a few words.
    `motorgrad.presets` has it as a function that returns the learner."""

    def registered(table: Table) -> Table:
        PRESETS[name] = table
        PURPOSES[name] = purpose
        ordered = sorted(PRESETS.items())  # whichever file is imported first
        PRESETS.clear()
        PRESETS.update(ordered)
        return table

    return registered


class Measured(NamedTuple):
    """Of a preset: the processor time of a decision in ms, on the cheapest and the dearest task, in words (`cost`);
    what was reached, by task (`reached`)."""

    cost: str
    reached: Mapping[str, str]


def measured(preset: str) -> Measured | None:
    """What a preset was seen to reach, of the stored runs from which `python -m tools.which_preset table` draws
    `measured.json`; `None` for one that was not measured."""
    found = _stored().get(preset)
    return None if found is None else Measured(**found)


@functools.cache
def _stored() -> dict[str, Any]:
    text = files("motorgrad.learning.algorithms").joinpath("measured.json").read_text(encoding="utf-8")
    return json.loads(text)


def behind_layers(task: Learnable, network: Mapping[str, Any], policy: PolicyTable | None = None) -> dict[str, Any]:
    """A policy that sees the output of hidden layers in place of fixed features: `policy`, or that for the task's kind
    of actions. One that takes no layers is refused when it is made."""
    given = POLICIES.get(task.actions, POLICIES["mixed"]) if policy is None else policy
    kept = {"kind": given} if isinstance(given, str) else {key: given[key] for key in given if key != "features"}
    return {**kept, "network": network}


def in_batches(
    task: Learnable,
    policy: PolicyTable | None,
    *,
    batch: int | str,
    decay: float,
    fit: Mapping[str, Any],
    discount: float = DISCOUNT,
    **estimator: object,
) -> dict[str, Any]:
    """A batch method as a table: networks, scaled rewards, and generalised advantages from a critic, with the policy
    updated every `batch` decisions, the lambda `decay`, the critic's `fit`, and further settings of the `estimator`."""
    return {
        "policy": behind_layers(task, SMALL, policy),
        "estimator": {
            "trace": {"kind": "exponential", "decay": discount * decay},
            "baseline": {"kind": "network-critic", "discount": discount, "decay": decay, "network": SMALL, "fit": fit},
            "update_every": batch,
            "reward_scaling": {"discount": discount},
            **estimator,
        },
    }


def fitted_returns(batch: int, passes: int, learning_rate: float) -> dict[str, Any]:
    """A critic's fit to the returns of each batch, a step for each pass over it."""
    return {"kind": "fitted-returns", "interval": batch, "passes": passes, "learning_rate": learning_rate}


def large_batch(steps: int) -> int:
    """The decisions of a batch of PPO and TRPO: a fiftieth of a training, from 256 to 2,048, a multiple of 64."""
    return 64 * (min(2048, max(256, steps // 50)) // 64)


def horizon(task: Learnable, share: float) -> float:
    """How many decisions a critic looks ahead: a `share` of an episode. What comes later hardly depends on a decision,
    but adds its noise."""
    return min(100.0, max(10.0, share * (task.longest_episode or 200)))
