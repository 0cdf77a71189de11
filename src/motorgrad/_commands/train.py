"""`motorgrad train TASK`: learn."""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np

from motorgrad._commands._shared import in_words, parse, summary, write_json
from motorgrad._errors import unknown
from motorgrad.tasks import TASKS
from motorgrad.training import Run, settings_for, train


@dataclasses.dataclass(frozen=True)
class Options:
    """Options of `motorgrad train`, beside those of the task and of the agent."""

    steps: int = 100_000
    """Decisions per seed."""
    seeds: int = 1
    """How many seeds, numbered from --first-seed."""
    first_seed: int = 0
    """The first seed."""
    out: Path | None = None
    """The run directory, by default runs/TASK. An unfinished run found there goes on."""
    window: int | None = None
    """Decisions per record of the metrics; by default a two-hundredth of the steps."""
    checkpoint_every: float = 30.0
    """Seconds between checkpoints."""
    threads: int = 0
    """Threads that step the physics; 0 for one per processor."""
    json: Path | None = None
    """Also write the result to this file, for machines; - for the standard output."""


def run(arguments: list[str]) -> int:
    if not arguments or arguments[0].startswith("-"):
        print(f"usage: motorgrad train TASK [options]\n\ntasks: {', '.join(TASKS)}\n")
        print("motorgrad train TASK --help lists the options of a task and of its learner.")
        return 0 if arguments[:1] in (["-h"], ["--help"]) else 2
    name, *rest = arguments
    if name not in TASKS:
        raise unknown("task", name, TASKS)
    task = TASKS[name]()
    agent = settings_for(task)
    command: Any = dataclasses.make_dataclass(
        "Train",
        [
            ("task", type(task), dataclasses.field(default=task)),
            ("agent", type(agent), dataclasses.field(default=agent)),
        ],
        bases=(Options,),
        frozen=True,
    )
    command.__doc__ = f"Learn: {(type(task).__doc__ or '').partition(chr(10))[0]}"
    options = parse(command, rest, f"train {name}")
    out = options.out or Path("runs") / name
    seeds = range(options.first_seed, options.first_seed + options.seeds)
    result = train(
        options.task,
        options.agent.agent(options.task),
        options.steps,
        seeds,
        out,
        window=options.window,
        checkpoint_every=options.checkpoint_every,
        threads=options.threads,
    )
    found = _result(result)
    if str(options.json) != "-":
        _say(result, found, out)
    write_json(options.json, found)
    return 0 if result.complete else 130


def _result(run: Run) -> dict[str, Any]:
    """The last tenth of the run, per seed."""
    skipped = {"seed", "decision", "simulated_time", "wall_time", "parameters", "baseline"}
    found: dict[str, Any] = {
        "task": run.task.name,
        "path": str(run.path),
        "decisions": run.decision,
        "complete": run.complete,
        "simulated_time": run.decision * run.task.period,
        "wall_time": float(run.metrics["wall_time"][-1].as_py()) if run.metrics.num_rows else 0.0,
    }
    for name in run.metrics.column_names:
        if name not in skipped and run.metrics.num_rows:
            values = run.curve(name)[1]
            last = values[:, -max(1, values.shape[1] // 10) :]
            counted = name.endswith("_count") or name in ("episodes", "diverged")
            with np.errstate(invalid="ignore"):
                mean = np.nansum(last, axis=1) / np.isfinite(last).sum(axis=1)
            found[f"{name}_total" if counted else name] = summary(values.sum(axis=1) if counted else mean)
    return found


def _say(run: Run, found: dict[str, Any], out: Path) -> None:
    done = "done" if run.complete else "stopped"
    print(f"{done} after {run.decision:,} decisions per seed; means over the last tenth of the records, and totals:")
    for name, value in found.items():
        # A count of occurrences is for machines; divergences are said if there were any.
        quiet = name.endswith("_count_total") or (name == "diverged_total" and not any(value["per_seed"]))
        if isinstance(value, dict) and not quiet:
            print(f"  {in_words(name.replace('_', ' '), value)}")
    print(f"saved in {out}")
    if not run.complete:
        print("the same command goes on where it stopped")
    else:
        print(f"next: motorgrad plot {out}    motorgrad evaluate {out}")
