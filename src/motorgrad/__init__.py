"""motorgrad: learning motor control by policy gradients. Small stochastic units, each deciding whether its muscle
fires, learn online from one stream of experience:

    import motorgrad as mg

    task = mg.make("hopper")
    agent = mg.Agent(mg.policies.hyperplanes(task), mg.learning.olgarb(decay=0.995), mg.learning.SGD(5e-4))
    run = mg.train(task, agent, steps=100_000, seeds=16, out="runs/hopper")
    run.plot()

Names are loaded when first used, so that importing the package is quick.
"""

import importlib
from typing import TYPE_CHECKING, Any

from motorgrad._collection import collecting_seldom
from motorgrad._compiler import compile_small_loops_whole
from motorgrad._gymnasium_ids import register_with_gymnasium
from motorgrad._platform import use_the_processor

__version__ = "0.1.0"

_ROOM_OF = {
    "Agent": "learning",
    "Comparison": "studies",
    "Run": "training",
    "Study": "studies",
    "agent_for": "training",
    "compare": "studies",
    "evaluate": "training",
    "load": "training",
    "make": "tasks",
    "resume": "training",
    "rollout": "training",
    "train": "training",
}

__all__ = [
    "Agent",
    "Comparison",
    "Run",
    "Study",
    "agent_for",
    "bodies",
    "compare",
    "environments",
    "evaluate",
    "export",
    "learning",
    "load",
    "make",
    "plane",
    "policies",
    "presets",
    "resume",
    "rollout",
    "search",
    "statistics",
    "studies",
    "tasks",
    "train",
    "training",
    "worlds",
]

if TYPE_CHECKING:
    from motorgrad import (
        bodies,
        environments,
        export,
        learning,
        plane,
        policies,
        presets,
        search,
        statistics,
        studies,
        tasks,
        training,
        worlds,
    )
    from motorgrad.learning import Agent
    from motorgrad.studies import Comparison, Study, compare
    from motorgrad.tasks import make
    from motorgrad.training import Run, agent_for, evaluate, load, resume, rollout, train


def __getattr__(name: str) -> Any:
    with collecting_seldom():
        if name in _ROOM_OF:
            return getattr(importlib.import_module(f"motorgrad.{_ROOM_OF[name]}"), name)
        if name in __all__:  # a room
            return importlib.import_module(f"motorgrad.{name}")
    raise AttributeError(f"module 'motorgrad' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)


use_the_processor()
compile_small_loops_whole()
register_with_gymnasium()
