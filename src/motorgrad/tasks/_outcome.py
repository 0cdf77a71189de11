"""What an action led to: the one order in which a task's functions are asked."""

from typing import Any, NamedTuple

from jaxtyping import Array, Bool, Float, Int

from motorgrad.tasks._task import Task


class Outcome(NamedTuple):
    """After a step of the dynamics: the task's `memory`; the `observation`, before any reset; the `reward`; whether the
    episode `terminated` or was `truncated`, plainly `False` where it never is; how many decisions have `elapsed` in it,
    `None` without a limit."""

    memory: Any
    observation: Float[Array, " inputs"]
    reward: Float[Array, ""]
    terminated: Bool[Array, ""] | bool
    truncated: Bool[Array, ""] | bool
    elapsed: Int[Array, ""] | None


def outcome(
    task: Task, memory: Any, state: Any, action: Array, observe: Float[Array, " uniforms"], elapsed: Array | None
) -> Outcome:
    """What the step that led to `state` by `action` means to a task.

    **Arguments:** the task and its memory; the state and the action; `observe`, the numbers from U[0, 1) of the
    observation; `elapsed`, decisions made in the episode before this one, `None` where it has no limit.

    **Raises** `TypeError` where a task reports the end of an episode and does not say that it is `episodic`.
    """
    memory, reward, terminated = task.reward(memory, state, action)
    truncated: Any = task.truncated(memory, state)
    for flag, name in ((terminated, "terminated"), (truncated, "truncated")):
        if flag is not False and not task.episodic:
            raise TypeError(f"task {task.name!r} reports `{name}`, so its class must say `episodic = True`")
    memory, observation = task.observe(memory, state, observe)
    if elapsed is not None:
        elapsed = elapsed + 1
        over = elapsed >= (task.episode_limit or 0)
        truncated = over if truncated is False else truncated | over
    if terminated is not False and truncated is not False:
        truncated = truncated & ~terminated
    return Outcome(memory, observation, reward, terminated, truncated, elapsed)
