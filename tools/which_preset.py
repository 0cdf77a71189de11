"""Which preset when: presets and peers on the same tasks, to the same budgets: `python -m tools.which_preset`.

    python -m tools.which_preset learn two-joints --learner chosen      # what `mg.train(task)` does, five seeds
    python -m tools.which_preset learn pendulum --learner sbx-sac       # a peer
    python -m tools.which_preset cost half-cheetah                      # processor time beside SAC of peers, in one run
    python -m tools.which_preset table                                  # the page's tables, from the stored runs

Run it from the root of a checkout. Each run is stored as one JSON file in `docs/data`. Settings were chosen on seeds
from 100 on, and on the first arm alone. What is reported learns from seed 0 on, and is judged by the most probable
actions on 20 episodes with fresh starts, of an arm on 100. Peers need `sbx-rl` and `gymnasium[box2d]` beside the extra
`peers`.
"""

# pyright: reportMissingImports=false
# (the peers are no dependency of any extra: they are installed for this table alone)

import argparse
import dataclasses
import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import motorgrad as mg
from motorgrad._files import write_atomically
from motorgrad.learning import PRESETS, PURPOSES
from motorgrad.tasks import Task, compose, terms
from motorgrad.training import agent_for, choice_for, provenance, stepper_for
from tools import myosuite, streaming
from tools.myosuite import DATA, ROOT, Clock
from tools.streaming import in_brackets, in_three_digits

ARMS = ROOT / "tools" / "arms"
PAGE = ROOT / "docs" / "which-preset.md"
MEASURED = ROOT / "src" / "motorgrad" / "learning" / "algorithms" / "measured.json"
"""What `motorgrad list presets` says of each preset."""
EPISODES = 20
"""Episodes of a seed by which a policy is judged."""
ARM_EPISODES = 100
"""Likewise for arms, whose episodes differ more."""
CHOSEN = "chosen"
"""The learner that a task gets by itself."""
ONE_THREAD = "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"


Point = tuple[float, float, float]


@dataclasses.dataclass(frozen=True)
class Trial:
    """A task of the table.

    - `title`: the task in a table.
    - `steps`: the budget, in decisions per seed.
    - `arm`: the file of an arm that reaches for places in a `box` in front of it, from its lowest to its highest
      corner, in m, of which `reachable` leaves those that some pose reaches; or `env_id`, of Gymnasium, with the
      `kwargs` of its `make`.
    """

    title: str
    steps: int
    arm: str | None = None
    box: tuple[Point, Point] | None = None
    reachable: bool = False
    env_id: str = ""
    kwargs: Mapping[str, Any] = dataclasses.field(default_factory=dict)

    def make(self) -> Task:
        """Our task."""
        if self.arm is None:
            return mg.tasks.from_gymnasium(self.env_id, **self.kwargs)
        assert self.box is not None
        low, high = self.box
        return compose(
            ARMS / f"{self.arm}.xml",
            targets=[terms.Reach("hand", low=low, high=high, reachable=self.reachable)],
            observe=["joint-positions", "joint-velocities", "target", "target-error"],
            reward=[terms.Distance(), terms.Closeness(width=0.05), terms.Effort(weight=-0.05)],
            reset=[terms.RandomJoints(share=0.5)],
            metrics=["distance", terms.Within(tolerance=0.03, name="solved")],
            time_limit=2.0,
        )

    @property
    def metric(self) -> str:
        """What a policy is judged by: the return of an episode, or the share of decisions on target in percent."""
        return "return" if self.arm is None else "solved"

    @property
    def scale(self) -> float:
        return 1.0 if self.arm is None else 100.0


REACH = 60_000
"""Decisions for an arm: 20 minutes of its life."""
TRIALS = {
    "two-joints": Trial(
        "arm of two joints and six muscles, gravity",
        REACH,
        "two-joints-six-muscles",
        ((0.25, 0.0, -0.35), (0.45, 0.0, -0.1)),
    ),
    "three-joints": Trial(
        "arm of three joints and nine muscles, gravity",
        REACH,
        "shoulder-elbow-wrist",
        ((0.25, 0.0, -0.4), (0.5, 0.0, -0.1)),
    ),
    "in-space": Trial(
        "arm in space, three joints and nine muscles, gravity",
        REACH,
        "shoulder-in-space",
        ((0.2, -0.35, -0.3), (0.4, -0.1, 0.0)),
        reachable=True,
    ),
    "light": Trial(
        "light arm of two joints and four muscles", REACH, "light-arm", ((0.0, 0.12, 0.0), (0.2, 0.28, 0.0))
    ),
    "pendulum": Trial("Pendulum-v1", 10_000, env_id="Pendulum-v1"),
    "reacher": Trial("Reacher-v5", 10_000, env_id="Reacher-v5"),
    "half-cheetah": Trial("HalfCheetah-v5", 10_000, env_id="HalfCheetah-v5"),
    "hopper": Trial("Hopper-v5", 10_000, env_id="Hopper-v5"),
    "lunar-lander-continuous": Trial(
        "LunarLander-v3, continuous", 10_000, env_id="LunarLander-v3", kwargs={"continuous": True}
    ),
    "lunar-lander": Trial("LunarLander-v3", 300_000, env_id="LunarLander-v3"),
}
"""Tasks by short name."""
PEERS = {
    "sb3-sac": "stable-baselines3's SAC, its defaults",
    "sbx-sac": "SBX's SAC, its defaults",
    "sb3-ppo": "stable-baselines3's PPO, its defaults",
}
"""Peers, and whose settings they have."""


def learn(trial: Trial, learner: str, seeds: list[int], steps: int) -> dict[str, Any]:
    """A learner of ours."""
    task = trial.make()
    choice = choice_for(task, steps=steps) if learner == CHOSEN else None
    preset = learner if choice is None else choice.preset
    agent = agent_for(task, preset=preset, steps=steps)
    run = mg.train(task, agent, steps, seeds, window=max(1, steps // 20), threads=1, progress=False)
    if not run.complete:  # it was asked to stop
        raise KeyboardInterrupt
    episodes = EPISODES if trial.arm is None else ARM_EPISODES
    decisions = episodes * (task.longest_episode or steps)
    found = mg.evaluate(run, decisions, mode="mode", threads=1)
    cpu = float(run.metrics["cpu_time"][-1].as_py()) / len(seeds)
    earned = trial.scale * np.asarray(found.metrics[trial.metric], float)
    return {"preset": preset, "cpu": [cpu] * len(seeds), "evaluated": earned, "settings": run.config["agent"]}


def learn_peer(trial: Trial, learner: str, seeds: list[int], steps: int) -> dict[str, Any]:
    """A peer on the same environment, on one core, each seed in a process of its own."""
    found = [_in_process(trial, learner, seed, steps) for seed in seeds]
    return {name: [each[name] for each in found] for name in ("cpu", "evaluated")}


def _in_process(trial: Trial, learner: str, seed: int, steps: int) -> dict[str, float]:
    what = json.dumps([learner, trial.env_id, dict(trial.kwargs), steps, seed])
    command = [sys.executable, "-m", "tools.which_preset", "peer", what]
    made = subprocess.run(
        command, check=True, capture_output=True, text=True, env={**os.environ, "XLA_FLAGS": ONE_THREAD}
    )
    return json.loads(made.stdout.splitlines()[-1])


def peer(learner: str, env_id: str, kwargs: dict[str, Any], steps: int, seed: int) -> dict[str, float]:
    """One seed of a peer: its processor seconds, and the mean return of fresh episodes by its most probable actions."""
    import gymnasium
    import torch
    from stable_baselines3.common.evaluation import evaluate_policy
    from stable_baselines3.common.monitor import Monitor

    torch.set_num_threads(1)
    library, kind = learner.split("-")
    if library == "sbx":
        import sbx as peers
    else:
        import stable_baselines3 as peers
    model = getattr(peers, kind.upper())("MlpPolicy", gymnasium.make(env_id, **kwargs), seed=seed, device="cpu")
    clock = Clock()
    model.learn(steps)
    cpu = clock.read()["cpu"]
    trial = Monitor(gymnasium.make(env_id, **kwargs))
    trial.reset(seed=seed + 1_000_000)
    mean, _ = evaluate_policy(model, trial, n_eval_episodes=EPISODES, deterministic=True)
    return {"cpu": cpu, "evaluated": float(np.mean(mean))}


def cost(trial: Trial, rounds: int = 5, chunk: int = 1_000) -> dict[str, list[float]]:
    """Processor time of SAC a decision, in ms, ours and peers' in turn in one process, without compilation: each learns
    on by a `chunk` of decisions in every round."""
    import gymnasium
    import sbx
    import stable_baselines3
    import torch

    torch.set_num_threads(1)
    task = trial.make()
    stepper = stepper_for(task, agent_for(task, preset="sac", steps=trial.steps), [0], threads=1)
    learns: dict[str, Any] = {"sac": lambda: stepper.advance(chunk)}
    for name, library in (("sb3-sac", stable_baselines3), ("sbx-sac", sbx)):
        model = library.SAC("MlpPolicy", gymnasium.make(trial.env_id, **trial.kwargs), seed=0, device="cpu")
        learns[name] = lambda model=model: model.learn(chunk, reset_num_timesteps=False)
    for learn_first in learns.values():  # compiles, and fills the replay
        learn_first()
    found: dict[str, list[float]] = {name: [] for name in learns}
    for _ in range(rounds):
        for name, learn_on in learns.items():
            clock = Clock()
            learn_on()
            found[name].append(1e3 * clock.read()["cpu"] / chunk)
    return found


def stored() -> list[dict[str, Any]]:
    """The stored runs, in the order of tasks, ours before peers'."""
    found = [json.loads(path.read_text(encoding="utf-8")) for path in DATA.glob("which-preset-*.json")]
    learners = [CHOSEN, *PRESETS, *PEERS]
    return sorted(found, key=lambda run: ([*TRIALS].index(run["task"]), learners.index(run["learner"])))


def table() -> str:
    """What each learner reached on each task, and what it cost, in Markdown."""
    titles = ["task", "decisions", "learner", "seeds", "reached, median [least … greatest]", "CPU s per seed"]
    lines = [f"| {' | '.join(titles)} |", "|---" * len(titles) + "|"]
    for run in stored():
        trial = TRIALS[run["task"]]
        unit = " %" if trial.arm else ""
        name = f"`{run['learner']}`"
        if run["learner"] == CHOSEN:
            name = f"**by itself: `{run['preset']}`**"
        elif run["learner"] in PEERS:
            name = PEERS[run["learner"]]
        cells = [trial.title, f"{run['steps']:,}", name, str(len(run["seeds"]))]
        cells += [in_brackets(np.array(run["evaluated"])) + unit, f"{np.mean(run['cpu']):,.0f}"]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


class Seen(NamedTuple):
    """What a preset reached on a task, in words, and its processor time of a decision in ms."""

    preset: str
    task: str
    reached: str
    cost: float


def seen() -> Iterator[Seen]:
    """Stored runs of presets: of this table, of the streaming learners, and of MyoSuite."""
    for run in stored():
        if run["learner"] in PEERS:
            continue
        trial = TRIALS[run["task"]]
        middle = in_three_digits(float(np.median(run["evaluated"])))
        reached = f"{middle} %" if trial.arm else middle
        yield Seen(run["preset"], trial.title, _after(reached, run), 1e3 * float(np.mean(run["cpu"])) / run["steps"])
    for name, task in streaming.TASKS.items():
        for run in streaming.stored(name):
            if run["learner"] in PRESETS and run["learner"] in streaming.OURS:
                middle = in_three_digits(float(np.median(streaming.earned(run))))
                yield Seen(
                    run["learner"],
                    f"{task.env_id} ({task.label})",
                    _after(middle, run),
                    1e3 * run["cpu"] / run["steps"],
                )
    for run in myosuite.stored():
        if run["learner"] in PRESETS and run["learner"] in myosuite.OURS:
            solved = 100 * float(np.median(run["evaluated"]["mode"]["solved"]))
            cost = 1e3 * run["took"]["cpu"] / len(run["seeds"]) / run["steps"]
            yield Seen(run["learner"], run["env_id"], _after(f"{solved:.0f} % of decisions solved", run), cost)


def _after(reached: str, run: Mapping[str, Any]) -> str:
    return f"{reached} after {run['steps']:,} decisions"


def measured() -> dict[str, Any]:
    """By preset what it was seen to reach, and its processor time a decision, for `motorgrad list presets`."""
    found: dict[str, Any] = {}
    for each in sorted(seen(), key=lambda each: [*PRESETS].index(each.preset)):
        entry = found.setdefault(each.preset, {"cost": [], "reached": {}})
        entry["cost"].append(each.cost)
        entry["reached"][each.task] = each.reached
    for entry in found.values():
        ends = [f"{end(entry['cost']):.2g}" for end in (min, max)]
        entry["cost"] = " … ".join(dict.fromkeys(ends))
    return found


def purposes() -> str:
    """What each preset is for, with its cost and an example of what it reached, in Markdown."""
    known = measured()
    lines = ["| preset | for | CPU ms a decision |", "|---|---|---|"]
    for name in PRESETS:
        cost = known[name]["cost"] if name in known else "–"
        lines.append(f"| `{name}` | {PURPOSES[name]} | {cost} |")
    return "\n".join(lines)


def draw() -> None:
    """Put the tables into their page, and what presets reached beside them."""
    page = PAGE.read_text(encoding="utf-8")
    for name, made in (("purposes", purposes()), ("table", table())):
        between = rf"(<!-- {name} -->\n).*?(\n<!-- end -->)"
        page = re.sub(between, lambda at, made=made: at[1] + made + at[2], page, flags=re.DOTALL)
    write_atomically(PAGE, page.encode())
    write_atomically(MEASURED, f"{json.dumps(measured(), indent=1, ensure_ascii=False)}\n".encode())


def main(arguments: list[str] | None = None) -> None:
    """Learn and store, or draw the tables."""
    parser = argparse.ArgumentParser(
        prog="python -m tools.which_preset", description=(__doc__ or "").partition("\n")[0]
    )
    commands = parser.add_subparsers(dest="command", required=True)
    learning = commands.add_parser("learn", help="train and store")
    learning.add_argument("task", choices=TRIALS)
    learning.add_argument("--learner", choices=[CHOSEN, *PRESETS, *PEERS], default=CHOSEN)
    learning.add_argument("--seeds", type=int, default=5, help="how many, from --first")
    learning.add_argument("--first", type=int, default=0, help="the first seed; settings were chosen on 100 and above")
    learning.add_argument("--steps", type=int, default=None, help="decisions per seed; by default those of the table")
    learning.add_argument("--out", type=Path, default=DATA)
    costing = commands.add_parser("cost", help="processor time of SAC beside that of peers, in one run")
    costing.add_argument("task", choices=[name for name, trial in TRIALS.items() if trial.arm is None])
    commands.add_parser("peer", help="one seed of a peer, as JSON").add_argument("what")
    commands.add_parser("table", help="draw the tables of docs/which-preset.md from the stored runs")
    given = parser.parse_args(arguments)
    if given.command == "table":
        draw()
        return
    if given.command == "peer":
        print(json.dumps(peer(*json.loads(given.what))))
        return
    trial = TRIALS[given.task]
    if given.command == "cost":
        found = cost(trial)
        for name, each in found.items():
            ratios = np.array(found["sac"]) / np.array(each)
            print(f"{name}: {in_brackets(np.array(each))} ms a decision; sac ÷ {name}: {in_brackets(ratios)}")
        return
    steps = given.steps or trial.steps
    seeds = list(range(given.first, given.first + given.seeds))
    work = learn_peer if given.learner in PEERS else learn
    made: dict[str, Any] = {"task": given.task, "learner": given.learner, "steps": steps, "seeds": seeds}
    made |= {"machine": {key: value for key, value in provenance().items() if key != "command"}}
    made |= work(trial, given.learner, seeds, steps)
    text = json.dumps(made, default=lambda v: np.round(np.asarray(v, float), 4).tolist(), indent=1)
    path = given.out / f"which-preset-{given.task}--{given.learner}.json"
    write_atomically(path, f"{text}\n".encode())
    print(path, made["cpu"], made["evaluated"])


if __name__ == "__main__":
    main()
