"""Presets: learners for any task, in proportion to a budget, whose parts can be changed one by one.

All return a `Learner`, and are called as `natural(task, steps=100_000, changes=None, **more)`, which has the arguments.
Each stands in the file of its algorithm, in `motorgrad.learning.algorithms`. `choose` says which one a task gets by
itself.
"""

from typing import TYPE_CHECKING

from motorgrad.training import PRESETS, Choice, choose, preset_agent

if TYPE_CHECKING:
    from motorgrad.training import PresetAgent

    def __getattr__(name: str) -> PresetAgent: ...


globals().update({name.replace("-", "_"): preset_agent(name) for name in PRESETS})
__all__ = ["PRESETS", "Choice", "choose", *(name.replace("-", "_") for name in PRESETS)]  # pyright: ignore[reportUnsupportedDunderAll]
