"""A live view of a learner or a model, from Python."""

# pyright: reportAttributeAccessIssue=false
# (the bindings of mujoco carry no types)
from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import mujoco

    from motorgrad.bodies import Body
    from motorgrad.learning import Agent
    from motorgrad.sim.live import Stage
    from motorgrad.sim.page import Page
    from motorgrad.sim.planet import Planet
    from motorgrad.tasks import Task
    from motorgrad.training import AgentSettings, Run


def view(
    task: Task | Body | mujoco.MjModel | Path | str,
    agent: Agent | AgentSettings | None = None,
    *,
    seed: int = 0,
    run: Run | Path | str | None = None,
    frozen: bool = False,
    stage: Stage | None = None,
    planet: Planet | None = None,
    playing: bool = True,
    speed: float = 1.0,
    host: str = "127.0.0.1",
    port: int | None = None,
) -> Page:
    """Let an agent learn a task, or simulate a model, in a process of its own, and show it live in the browser.

    **Arguments:**

    - `task`: a task or the name of one; or what has no learner: a body or the name of one (`"arm"`), a MuJoCo model, or
      the path of an MJCF file.
    - `agent`: what learns, or the settings of it; by default the learner that goes with the task.
    - `seed`: of its random numbers; with a `run`, which of its seeds.
    - `run`: a run of the task, or the directory of one, whose policy to begin with.
    - `frozen`: begin without learning.
    - `stage`: gravity, physics step, terrain and cameras (`motorgrad.sim.live.Stage`).
    - `planet`: a round world to walk on, for a task on level ground whose body hangs on nothing, such as `"hexapod"`.
    - `playing`: whether it begins at once.
    - `speed`: simulated seconds per second, at least 0.05; `math.inf` for as fast as possible.
    - `host`, `port`: where the page listens. Whoever reaches another host than 127.0.0.1 can drive the simulation. By
      default the port is 8080, or the next that is free.

    **Returns** a `Page`, which a notebook shows. `page.url` says where it is, `page.wait()` waits until it is over,
    `page.close()` ends it; `page.session` is the run itself.

    **Raises** `ValueError` for what cannot be simulated, naming it, before anything starts.
    """
    from motorgrad.sim.page import show

    return show(task, agent, seed, run, frozen, stage, planet, playing, speed, host, port)
