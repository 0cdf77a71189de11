"""The two ways into training: a new run, and one that is resumed."""

from collections.abc import Iterable, Mapping, Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import Any

from motorgrad._arguments import check_arguments
from motorgrad._collection import collecting_seldom
from motorgrad._errors import check
from motorgrad._platform import tell_the_platform
from motorgrad._program_store import keep_programs
from motorgrad.learning import Learner
from motorgrad.policies import Policy
from motorgrad.tasks import Task
from motorgrad.training._arguments import check_training
from motorgrad.training._callbacks import Callback, check_callbacks
from motorgrad.training._load import given_initial, saved_config
from motorgrad.training._progress import TrainingProgress
from motorgrad.training._run import Run, saved_agent, saved_task
from motorgrad.training._saving import GIVE_UP_AFTER, Saving
from motorgrad.training._sweep import Sweep
from motorgrad.training._training import Training
from motorgrad.training._trust import task_named
from motorgrad.training.engines import check_carries
from motorgrad.training.plots import check_tensorboard
from motorgrad.training.store import RunDirectory


def train(
    task: Task | str,
    agent: Learner | Mapping[str, Any] | None = None,
    steps: int = 100_000,
    seeds: int | Sequence[int] | None = None,
    out: Path | str | None = None,
    *,
    sweep: Sweep | None = None,
    window: int | None = None,
    checkpoint_every: float = 30.0,
    threads: int = 0,
    envs: int = 1,
    workers: int = 0,
    progress: bool = True,
    tensorboard: bool = False,
    callbacks: Callback | Iterable[Callback] = (),
    initial: Policy | Run | None = None,
    give_up_after: float = GIVE_UP_AFTER,
    allow_changed: bool = False,
) -> Run:
    """Train an agent on a task, for many seeds at once.

    **Arguments:**

    - `task`: a task, or its name: as on the command line, also the id of a Gymnasium environment, such as
      `"Pendulum-v1"`, or a TOML file of a task.
    - `agent`: the learner; or changes to the task's own learner, as in `agent_for`; by default that learner, or that of
      the run where `initial` is one. A task without one gets a preset by what it is (`motorgrad.presets.choose`), which
      the first line of progress names. A run whose parts are all registered can be resumed from its directory alone
      (`resume`).
    - `steps`: decisions per seed, those of all its environments together. If the directory holds a run with more
      decisions, that run is returned.
    - `seeds`: their number (0, 1, 2 …), or a list of them; by default 1, or those of the run where `initial` is one.
    - `out`: the run directory. If it holds the same run, unfinished, training continues from its last checkpoint, bit
      for bit; if it is finished, it is returned, or continued where `steps` are more than before.
    - `sweep`: several settings of the agent's numbers, which learn side by side in one compiled call: a mapping from
      paths to lists of numbers, which combine as a product, or a list of mappings. Seed k has the same
      random numbers under every setting. `Run.split` gives the run of each setting.
    - `window`: decisions per record of the metrics, by default a two-hundredth of the steps, or what the run in the
      directory has.
    - `checkpoint_every`: seconds of wall time between checkpoints.
    - `threads`: for bodies, the threads of physics and learning; 0 for one per processor.
    - `envs`: environments that feed the learner of each seed, for bodies and Gymnasium environments. Each has its own
      episodes and its own trace; policy, critic, normalizations and metric are shared. `steps` and `window` must be
      multiples of it.
    - `workers`: processes in which Gymnasium environments are stepped; 0 for this process. The number changes no
      result.
    - `progress`: whether to show progress.
    - `tensorboard`: whether to write TensorBoard event files to `tensorboard/` of the run directory. They hold every
      record up to the newest checkpoint exactly once, also after a kill.
    - `callbacks`: functions that get every new record as a `Report`, with the present policies, to log it elsewhere for
      example; one or several. Where one returns True, training ends early, and the unfinished run is saved and returned
      (`EarlyStopping`); `EvaluationCallback` and `KeepBest` evaluate. They change no number.
    - `initial`: a run that the seeds continue, also on a changed body or task with the same observations and actions;
      or the policies from which they start, along a leading axis, such as the `policies` of a run; by default the
      agent's own. They must have the structure of the agent's policy. Running statistics of observations are taken
      over.
    - `give_up_after`: seconds after which the run ends if nothing could be saved in them, because the disk is full or
      the directory is gone. Until then it learns on, warns, tries again at every checkpoint, and loses nothing.
    - `allow_changed`: whether to continue a run whose settings, or version of motorgrad, are not those with which it
      was made. The present ones are used.

    **Returns** a `Run`.

    **Raises** `ValueError` for impossible settings and `RunDirectoryError` for a directory that cannot be used, both
    before any work starts; `NotSaved`, whose `run` is all that was learned, where a run ends and could not be saved.
    Ctrl-C or SIGTERM stops it, saves everything, and then raises `KeyboardInterrupt`, which says how far it is and has
    the unfinished run as `run`: a script does not go on with it unless it catches this.

    ```python
    run = mg.train("hopper", steps=100_000, seeds=16, out="runs/hopper")
    swept = mg.train("hopper", steps=100_000, seeds=16, sweep={"estimator.trace.decay": [0.98, 0.99, 0.995]})
    swept.plot("apex", "decay.png")
    ```
    """
    keep_programs()
    check_arguments(train, locals(), ("seeds", "out", "progress", "tensorboard", "allow_changed"))
    if isinstance(initial, Run):
        task = task_named(task) if isinstance(task, str) else task
        run = initial
        check(not run.settings, "initial", run, "a run of one setting: run.split()[0]")
        initial = run.whole_policies
        check_carries(task, initial, "initial")
        agent = saved_agent(task, run.config["agent"], "initial: the learner of the run") if agent is None else agent
        seeds = run.seeds if seeds is None else seeds
    seeds = 1 if seeds is None else seeds
    arguments = check_training(
        task, agent, steps, seeds, window, checkpoint_every, threads, initial, sweep, give_up_after, envs, workers
    )
    reported = check_callbacks(callbacks)
    tell_the_platform()
    if tensorboard:
        check(not arguments.settings, "tensorboard", tensorboard, "False for a sweep: write it for each of run.split()")
        check(out is not None, "tensorboard", tensorboard, "False for a run in memory: give `out`")
        check_tensorboard()
    lanes = len(arguments.seeds) * max(1, len(arguments.settings))
    with (
        collecting_seldom(),
        nullcontext() if out is None else RunDirectory(out) as directory,
        TrainingProgress(arguments.task, lanes, arguments.steps, progress) as report,
    ):
        report.tell_choice(arguments.choice)
        saving = None if directory is None else Saving(directory, checkpoint_every, give_up_after)
        training = Training(arguments, saving, threads, reported)
        if directory is not None:
            training.open(directory, window, allow_changed)
            training.write_events(directory, tensorboard)
        return training.run(report)


def resume(
    path: Path | str,
    steps: int | None = None,
    *,
    checkpoint_every: float = 30.0,
    threads: int = 0,
    workers: int = 0,
    progress: bool = True,
    callbacks: Callback | Iterable[Callback] = (),
    give_up_after: float = GIVE_UP_AFTER,
    trust: bool = False,
    allow_changed: bool = False,
) -> Run:
    """Resume the run in a directory, with its own task, learner, seeds, environments and sweep.

    **Arguments:**

    - `path`: the run directory.
    - `steps`: decisions per seed, by default those of the run.
    - `trust`: whether to run code that the directory names: the module of its task.
    - `allow_changed`: whether settings in `config.toml` may differ from those with which the run was made, and the
      version of motorgrad. The present ones are used.
    - the others as in `train`; they do not change any number.

    **Returns** the `Run`; a finished one is returned as it is.

    **Raises** `RunDirectoryError` where there is no run, where a setting was changed, and where the task or agent was
    made in Python: pass these to `train` with `out=path`. `NotTrusted` where code would run.
    """
    check_arguments(resume, locals(), ("path", "progress", "trust", "allow_changed"))
    config = saved_config(path, allow_changed)
    task = saved_task(config, path, trust)
    run = config["run"]
    agent = saved_agent(task, config["agent"], f"{path}: agent")
    return train(
        task,
        agent,
        run["steps"] if steps is None else steps,
        run["seeds"],
        path,
        checkpoint_every=checkpoint_every,
        threads=threads,
        envs=run.get("envs", 1),
        workers=workers,
        progress=progress,
        callbacks=callbacks,
        initial=given_initial(path),
        sweep=config.get("sweep"),
        give_up_after=give_up_after,
        allow_changed=allow_changed,
    )
