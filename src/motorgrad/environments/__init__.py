"""Our tasks as Gymnasium environments, single and vector.

After `import motorgrad`, `gymnasium.make("motorgrad/Hopper-v0")` and `gymnasium.make_vec` find them. `TaskEnv(task)`
and `TaskVectorEnv(8, task)` make environments of your own tasks.
"""

from motorgrad.environments._environment import TaskEnv, TaskVectorEnv
from motorgrad.environments._spaces import as_array, check_action

__all__ = ["TaskEnv", "TaskVectorEnv", "as_array", "check_action"]
