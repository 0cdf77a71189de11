"""A live view of a learner or a model, from Python."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's bindings carry no types)
from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from motorgrad._arguments import check_arguments

if TYPE_CHECKING:
    import mujoco

    from motorgrad.bodies import Body
    from motorgrad.learning import Learner
    from motorgrad.tasks import Task
    from motorgrad.training import Run
    from timsim.film import Motion
    from timsim.live import Stage
    from timsim.page import Page
    from timsim.planet import Planet


def view(
    task: Task | Body | mujoco.MjModel | mujoco.MjSpec | Path | str,
    agent: Learner | Mapping[str, Any] | None = None,
    *,
    seed: int | Sequence[int] = 0,
    beside: Mapping[str, Any] | None = None,
    run: Run | Path | str | None = None,
    frozen: bool = False,
    stage: Stage | None = None,
    planet: Planet | None = None,
    motion: Motion | Path | str | None = None,
    playing: bool | None = None,
    speed: float = 1.0,
    host: str = "127.0.0.1",
    port: int | None = None,
    record: Path | str | None = None,
    wait: bool = True,
    trust: bool = False,
) -> Page:
    """Train an agent on a task, or simulate a model, and show it live in the browser. The simulation runs in its own
    process.

    **Arguments:**

    - `task`: a task or its name, the file of a composed one (.toml), or the id of one that `motorgrad.tasks.myosuite`
      rebuilds; or, without a learner, a body or its name (`"arm"`), a MuJoCo model or description, the path of an MJCF
      file, another id of MyoSuite, or one of its models, such as `"myofullbody"`.
    - `agent`: the learner, or changes of the learner that goes with the task; by default that learner itself.
    - `seed`: of the random numbers; with a `run`, which of its seeds, or several of them side by side. Several act and
      do not learn.
    - `beside`: other policies on the same task, by the label of their bodies, which act in step and do not learn: a
      run, its directory, or a pair of one and a seed; a policy, or a file of one (.npz); a model of stable-baselines3,
      or a file of one (.zip); anything with a method `predict(observation)`, or such a function, whose actions are
      those of the task's Gymnasium environment; or `"untrained"`.
    - `run`: a run of the task, or its directory, whose policy to start from.
    - `frozen`: start without learning.
    - `stage`: gravity, physics step, terrain and cameras (`timsim.live.Stage`).
    - `planet`: a round world (`timsim.planet.Planet`), for a task on level ground whose body is free to move,
      such as `"hexapod"`.
    - `motion`: a stored motion of the model, or its file (see `timsim.read_motion`), which is played.
    - `playing`: whether it starts at once; by default a learner and a motion do, and a model waits in its keyframe for
      Play.
    - `speed`: simulated seconds per second, at least 0.05; `math.inf` for as fast as possible.
    - `host`, `port`: where the page listens. Other machines reach a host other than 127.0.0.1; whoever knows the whole
      address can drive the simulation. The default port is 8080, or the next free one.
    - `record`: a file to record the run to from its start until `page.close()`: a film (".mp4", ".gif", ".webp"), or a
      replay (".html"), one page of at most 10 MB that plays anywhere without a server.
    - `wait`: whether to return only when the run has started. Without, the page is there at once and says what is being
      done until the body is in the picture; `page.ready()` waits for that, before which `page.session` cannot be used.
    - `trust`: whether files of stable-baselines3 among `beside` may be loaded, which runs code that they hold.

    **Returns** a `Page`, which a notebook shows. `page.url` is its whole address, `page.wait()` waits until it ends,
    `page.close()` ends it; `page.session` is the run.

    **Raises** `ValueError` for anything that cannot be simulated, and `NotTrusted` for a file of stable-baselines3
    without `trust`, before anything starts.

    ```py
    page = view("hopper", seed=3, speed=2.0)
    page.wait()

    view("hopper", run="runs/hop", seed=[0, 3, 5])                    # seeds of a run side by side
    view("hopper", beside={"PPO": model, "before": "untrained"})      # a model of stable-baselines3
    ```
    """
    check_arguments(view, locals())
    from motorgrad._errors import check
    from timsim.live import Session, Speed, setup_of, side_by_side
    from timsim.page import Page, check_port, warn_of

    for name, value in (("playing", playing), ("frozen", frozen), ("wait", wait), ("trust", trust)):
        check(value is None or isinstance(value, bool), name, value, "True or False")
    Speed(speed)  # refuses an impossible one before anything starts
    check_port(host, port)
    first, label, others = side_by_side(run, seed, beside)
    frozen = frozen or bool(label)
    given = {"run": run, "frozen": frozen, "stage": stage, "planet": planet, "beside": others, "label": label}
    setup = setup_of(task, agent, first, motion=motion, trust=trust, **given)
    warn_of(host)
    moving = setup.task is not None or setup.motion is not None
    playing = moving if playing is None else playing
    check(wait or record is None, "record", record, "left out without wait: call `page.record` after `page.ready()`")
    session = Session(setup, playing=playing, speed=speed, wait=False)
    try:
        page = Page(session, host, port, wait)
    except BaseException:
        session.close()
        raise
    if record is not None:
        try:
            page.record(record)
        except BaseException:
            page.close()
            raise
    return page
