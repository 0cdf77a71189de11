"""Every kind of learner, small, with tasks that suit it. A new kind has one entry here, and all tests of kinds find it.

What else they need they read from the declared fields of a kind and from what it says that it needs.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import motorgrad as mg
from motorgrad.learning import Learner
from motorgrad.schema import Range, declared_at, numbers_of
from motorgrad.tasks import LinearRecruitment, Task, ThreeState, from_gymnasium
from motorgrad.training import agent_for

PENDULUM = "Pendulum-v1"


class Suited(NamedTuple):
    """Tasks for learners that need the same of a task: the name of one to train on, with settings of its policy; a
    small one whose world is compiled, with settings of its policy; and the name of one for several environments."""

    trained: str
    policy: Mapping[str, Any]
    compiled: Task
    compiled_policy: Mapping[str, Any]
    several: str


class Family(NamedTuple):
    """Tasks that suit a kind of learner, and settings that make it small and have it learn within ten decisions."""

    suited: Suited
    settings: Mapping[str, Any]


POOL = LinearRecruitment(units=3, time_limit=5)
ANY = Suited("particle", {}, ThreeState(time_limit=5), {}, "hopper")
LOCAL = Suited("particle", {}, POOL, {"policy": "gaussians"}, "particle")
SQUASHED = {"policy": {"kind": "bounded-hyperplanes", "network": "none"}}
REAL = Suited(PENDULUM, SQUASHED, POOL, {"policy": "graded-motoneurons"}, PENDULUM)
CRITIC = {"kind": "critic", "fit": "td", "discount": 0.9}
NARROW = {"values": {"network": {"hidden": [4]}}}
KEPT = {"update_every": 4, "replay": {"capacity": 40, "start": 4, "batch": 3}}
FAMILIES = {
    "action-value-gradient": Family(REAL, NARROW),
    "policy-gradient": Family(ANY, {"update_every": 4}),
    "proximal": Family(ANY, {"baseline": CRITIC, "update_every": 4, "minibatches": 2, "epochs": 2}),
    "soft-actor-critic": Family(REAL, {**NARROW, **KEPT}),
    "sparse": Family(LOCAL, {"index.neglect": 0.02}),
    "twin-delayed": Family(REAL, {**NARROW, **KEPT}),
}


def made(name: str) -> Task:
    """A task, of ours or of Gymnasium, by name."""
    return from_gymnasium(name) if name == PENDULUM else mg.make(name)


def task_of(kind: str) -> Task:
    """The task that a kind of learner is trained on."""
    return made(FAMILIES[kind].suited.trained)


def learner_of(kind: str, **changes: Any) -> Learner:
    """A small learner of a kind for `task_of` it."""
    family = FAMILIES[kind]
    return agent_for(task_of(kind), {"kind": kind, **family.suited.policy, **family.settings, **changes})


def compiled(kind: str) -> tuple[Task, dict[str, Any]]:
    """A small task whose world is compiled, and settings of a small learner of a kind for it."""
    suited, settings = FAMILIES[kind]
    return suited.compiled, {"kind": kind, **suited.compiled_policy, **settings}


def short_and_path(kind: str) -> tuple[str, str]:
    """The first short name of a kind whose number may be ¼ or ½, and its path; without one, the path of such a number
    twice."""
    agent = learner_of(kind)
    own = numbers_of(agent.hyperparameters)
    names = {**type(agent).aliases, **dict(zip(own, own, strict=True))}
    return next(
        (short, path)
        for short, path in names.items()
        if path in own
        and not path.startswith("policy.")
        and all(map((declared_at(agent.hyperparameters, path).range or Range()).allows, (0.25, 0.5)))
    )
