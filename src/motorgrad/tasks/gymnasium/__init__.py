"""Any Gymnasium environment as a task."""

from motorgrad.tasks.gymnasium._batch import EnvironmentBatch, EnvironmentState
from motorgrad.tasks.gymnasium._gymnasium import EnvironmentMemory, Gymnasium, from_gymnasium

__all__ = ["EnvironmentBatch", "EnvironmentMemory", "EnvironmentState", "Gymnasium", "from_gymnasium"]
