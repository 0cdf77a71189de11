"""Our tasks as Gymnasium environments, single and vector.

After `import motorgrad`, `gymnasium.make("motorgrad/Hopper-v0")` and `gymnasium.make_vec` find them. A task of your own
becomes an environment with `TaskEnv(task)` or `TaskVectorEnv(8, task)`.
"""

from motorgrad.environments._environment import TaskEnv
from motorgrad.environments._vector import TaskVectorEnv

__all__ = ["TaskEnv", "TaskVectorEnv"]
