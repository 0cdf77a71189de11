"""Streaming learners and peers on the same tasks, to the same budgets: `python -m tools.streaming`.

    python -m tools.streaming learn hopper --learner stream-ac     # a learner of ours, ten seeds
    python -m tools.streaming learn hopper --learner mushroom      # a peer, three seeds
    python -m tools.streaming table                                # put the tables into docs/streaming-table.md

Run it from the root of a checkout. Each run is stored as one JSON file in `docs/data`. Settings were chosen on seeds
from 100 on. What is reported learns from seed 0 on.
"""

# pyright: reportMissingImports=false
# (MushroomRL is no dependency of any extra: it is installed for this table alone)

import argparse
import dataclasses
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

import motorgrad as mg
from motorgrad._files import write_atomically
from motorgrad.training import agent_for, provenance
from tools.myosuite import DATA, ROOT, Clock

PAGE = ROOT / "docs" / "streaming-table.md"
POINTS = 20
"""Of a learning curve: each is the mean over that part of the decisions."""


@dataclasses.dataclass(frozen=True)
class Task:
    """A task of the table: for us, for peers, and how it is scored.

    - `env_id`: of Gymnasium; `kwargs` of its `make`.
    - `name`: of our task; `None` for the environment itself.
    - `steps`: the budget, in decisions per seed.
    - `reading`: what is scored when it occurs: `return` is that of an episode, `reward` that of a decision.
    - `goal`: of the mean over 25 s of simulated time; how long a learner takes to it is reported.
    - `ours`: the settings of our learners that are not the presets' own, by learner; `mushroom`: those of MushroomRL's.
    - `label`: of what is scored, with its unit; `scale`: what it is multiplied by to have that unit.
    """

    env_id: str
    steps: int
    name: str | None = None
    reading: str = "return"
    kwargs: dict[str, Any] = dataclasses.field(default_factory=dict)
    goal: float | None = None
    ours: dict[str, dict[str, Any]] = dataclasses.field(default_factory=dict)
    mushroom: dict[str, float] = dataclasses.field(default_factory=dict)
    label: str = "return"
    scale: float = 1.0

    def make(self) -> Any:
        """Our task."""
        return mg.tasks.from_gymnasium(self.env_id) if self.name is None else mg.tasks.make(self.name, **self.kwargs)

    @property
    def period(self) -> float:
        """Simulated seconds of a decision."""
        return self.make().period


CLASSIC = {"olgarb-natural": {"decay": 0.98, "learning_rate": 1e-4}}
"""Of Gymnasium's tasks: the best of 18 settings on InvertedPendulum, seeds 100 to 103."""
WALK = 10_000
"""Decisions of the hexapods, 200 simulated seconds."""
TASKS = {
    "hopper": Task(
        "motorgrad/Hopper-v0",
        25_000,
        "hopper",
        "apex",
        {"reward_type": "apex"},
        0.3,
        {
            "olgarb": {"decay": 0.98, "learning_rate": 0.002},
            "actor-critic": {
                "decay": 0.98,
                "learning_rate": 0.005,
                "baseline": {"decay": 0.98, "fit": {"learning_rate": 0.001}, "centring": {"rate": 0.001}},
            },
            "olgarb-normalized": {"decay": 0.98, "learning_rate": 0.01},
            "olgarb-natural": {"decay": 0.98, "learning_rate": 0.0003},
        },
        {"alpha_theta": 1e-2, "alpha_v": 1e-3, "alpha_r": 1e-3, "lambda_par": 0.98},
        label="apex, m",
    ),
    "inverted-pendulum": Task("InvertedPendulum-v5", 50_000, ours=CLASSIC),
    "inverted-double-pendulum": Task("InvertedDoublePendulum-v5", 50_000, ours=CLASSIC),
    "swimmer": Task("Swimmer-v5", 50_000, ours=CLASSIC),
    "hopper-v5": Task("Hopper-v5", 50_000, ours=CLASSIC),
    "half-cheetah": Task("HalfCheetah-v5", 50_000, ours=CLASSIC),
    "hexapod-synergy": Task(
        "motorgrad/HexapodSynergy-v0",
        WALK,
        "hexapod-synergy",
        "reward",
        {"time_limit": 20.0},
        ours={"olgarb-natural": {"decay": 0.9, "learning_rate": 3e-4}},
        mushroom={"alpha_theta": 1e-2, "alpha_v": 1e-3, "alpha_r": 1e-3, "lambda_par": 0.97},
        label="speed, m/s",
        scale=1 / 4,
    ),
    "hexapod": Task(
        "motorgrad/Hexapod-v0",
        WALK,
        "hexapod",
        "reward",
        {"time_limit": 20.0},
        ours={"olgarb-natural": {"decay": 0.9, "learning_rate": 3e-4}},
        mushroom={"alpha_theta": 1e-2, "alpha_v": 1e-3, "alpha_r": 1e-3, "lambda_par": 0.97},
        label="speed along the course, m/s",
        scale=1 / 4,
    ),
}
"""Tasks by short name."""
OURS = {
    "olgarb": {"preset": None, "estimator": "olgarb"},
    "olgarb-normalized": {"preset": None, "estimator": "olgarb", "normalization": "root-mean-square"},
    "olgarb-natural": {"preset": None, "estimator": "olgarb", "metric": "fisher"},
    "actor-critic": {"preset": None, "estimator": "actor-critic"},
    "natural": {"preset": "natural"},
    "stream-ac": {"preset": "stream-ac"},
    "intentional-ac": {"preset": "intentional-ac"},
    "avg": {"preset": "avg"},
    "own": {"preset": None},
}
"""Our learners: changes to the task's own, which is `own`."""
PEERS = {
    "ppo": "Stable-Baselines3, its defaults",
    "a2c": "Stable-Baselines3, its defaults",
    "sac": "Stable-Baselines3, its defaults",
    "mushroom": "MushroomRL's average-reward actor-critic, with a Bernoulli policy",
}
"""Peers, and whose settings they have."""


def learn(task: Task, learner: str, seeds: list[int]) -> dict[str, Any]:
    """A learner of ours."""
    made = task.make()
    agent = agent_for(made, {**OURS[learner], **task.ours.get(learner, {})}, steps=task.steps)
    run = mg.train(made, agent, task.steps, seeds, window=task.steps // POINTS, threads=1, progress=False)
    if not run.complete:  # it was asked to stop
        raise KeyboardInterrupt
    _, curve = run.curve(task.reading)
    cpu = float(run.metrics["cpu_time"][-1].as_py())
    return {"cpu": cpu / len(seeds), "settings": run.config["agent"], "curve": task.scale * curve}


class Recorded(gymnasium.Wrapper):
    """Keeps what is scored: the return of every episode, every reward, or a reading of `info` when it occurs."""

    def __init__(self, environment: gymnasium.Env, reading: str):
        super().__init__(environment)
        self.reading = reading
        self.steps = 0
        self.seen = [(0, 0.0)][:0]
        self._return = 0.0

    def reset(self, **kwargs: Any) -> Any:
        self._return = 0.0
        return super().reset(**kwargs)

    def step(self, action: Any) -> Any:
        result = super().step(action)
        self.steps += 1
        self._return += float(result[1])
        if self.reading in result[4]:
            self.seen.append((self.steps, float(result[4][self.reading])))
        elif self.reading == "reward":
            self.seen.append((self.steps, float(result[1])))
        elif self.reading == "return" and (result[2] or result[3]):
            self.seen.append((self.steps, self._return))
        return result

    def curve(self, steps: int) -> np.ndarray:
        """The mean of what was seen in each part of the decisions, `(POINTS,)`."""
        at, values = np.array(self.seen).reshape(-1, 2).T
        parts = [values[np.ceil(at * POINTS / steps) == part + 1] for part in range(POINTS)]
        return np.array([part.mean() if len(part) else np.nan for part in parts])


class Thresholded(gymnasium.ActionWrapper):
    """Numbers from -1 to 1 in place of units that are on or off, for learners that take no others."""

    def __init__(self, environment: gymnasium.Env):
        super().__init__(environment)
        self.action_space = gymnasium.spaces.Box(-1, 1, environment.action_space.shape)

    def action(self, action: np.ndarray) -> np.ndarray:
        return (action > 0).astype(np.int8)


def learn_peer(task: Task, learner: str, seeds: list[int]) -> dict[str, Any]:
    """A peer, on the same environment."""
    took = 0.0
    curves = []
    for seed in seeds:
        environment = gymnasium.make(task.env_id, **task.kwargs)
        binary = isinstance(environment.action_space, gymnasium.spaces.MultiBinary)
        recorded = Recorded(Thresholded(environment) if binary and learner == "sac" else environment, task.reading)
        clock = Clock()
        if learner == "mushroom":
            mushroom(recorded, task.mushroom, task.steps, seed)
        else:
            stable_baselines(recorded, learner, task.steps, seed)
        took += clock.read()["cpu"]
        curves.append(task.scale * recorded.curve(task.steps))
    settings = task.mushroom if learner == "mushroom" else {}
    return {"cpu": took / len(seeds), "settings": settings, "curve": np.array(curves)}


def stable_baselines(environment: gymnasium.Env, learner: str, steps: int, seed: int) -> None:
    """Learn with Stable-Baselines3, on one core."""
    import stable_baselines3
    import torch

    torch.set_num_threads(1)
    getattr(stable_baselines3, learner.upper())("MlpPolicy", environment, seed=seed, device="cpu").learn(steps)


def mushroom(environment: gymnasium.Env, settings: dict[str, float], steps: int, seed: int) -> None:
    """Learn with MushroomRL's average-reward actor-critic (Degris et al., 2012), linear in the observation."""
    from mushroom_rl.algorithms.actor_critic import StochasticAC_AVG
    from mushroom_rl.core import MDPInfo
    from mushroom_rl.policy import ParametricPolicy
    from mushroom_rl.utils import spaces

    class Bernoulli(ParametricPolicy):
        """A unit for each action, on with the logistic function of its weighted inputs."""

        def __init__(self, units: int, inputs: int):
            self._weights = np.zeros((units, inputs))

        def _probability(self, state: np.ndarray) -> np.ndarray:
            return 1 / (1 + np.exp(-self._weights @ state))

        def draw_action(self, state: np.ndarray) -> np.ndarray:
            return (draws.random(len(self._weights)) < self._probability(state)).astype(np.int8)

        def diff_log(self, state: Any, action: Any) -> Any:  # pyright: ignore[reportIncompatibleMethodOverride]
            return np.outer(action - self._probability(state), state).ravel()

        def set_weights(self, weights: np.ndarray) -> None:
            self._weights = weights.reshape(self._weights.shape)

        def get_weights(self) -> np.ndarray:
            return self._weights.ravel()

        @property
        def weights_size(self) -> int:
            return self._weights.size

    draws = np.random.default_rng(seed)
    observation, _ = environment.reset(seed=seed)
    inputs = len(observation)
    units = len(environment.action_space.sample())
    box = spaces.Box(np.full(inputs, -np.inf), np.full(inputs, np.inf))
    info = MDPInfo(box, spaces.Discrete(2**units), 1.0, np.inf)
    agent = StochasticAC_AVG(info, Bernoulli(units, inputs), **settings)
    agent.episode_start()
    for _ in range(steps):
        action = agent.draw_action(observation)
        after, reward, terminated, truncated, _ = environment.step(action)
        agent.fit([(observation, action, reward, after, terminated, terminated or truncated)])
        observation = after
        if terminated or truncated:
            observation, _ = environment.reset()
            agent.episode_start()


def stored(task: str) -> list[dict[str, Any]]:
    """The stored runs of a task, ours before peers'."""
    found = [json.loads(path.read_text(encoding="utf-8")) for path in DATA.glob(f"streaming-{task}--*.json")]
    return sorted(found, key=lambda run: [*OURS, *PEERS].index(run["learner"]))


def reached(run: dict[str, Any]) -> np.ndarray | None:
    """Simulated seconds until each seed's curve is above the task's goal; infinite where it never is."""
    task = TASKS[run["task"]]
    if task.goal is None:
        return None
    each = np.array(run["curve"], float)
    # parts of at least 25 s
    width = max(1, round(25 / (task.steps / POINTS * task.period)))
    parts = np.split(np.nan_to_num(each), each.shape[1] // width, axis=1)
    means = np.stack([part.mean(axis=1) for part in parts], axis=1)
    first = np.where((means > task.goal).any(1), (means > task.goal).argmax(1) + 1, np.inf)
    return first * width * task.steps / POINTS * task.period


def tables() -> str:
    """A table for each task, in Markdown."""
    text = []
    for name, task in TASKS.items():
        found = stored(name)
        if not found:
            continue
        titles = ["learner", "runs", f"{task.label}, last tenth", "CPU s per seed"]
        titles += [] if task.goal is None else [f"simulated s until {task.goal} m", "CPU s until then", "seeds"]
        text += [f"**`{task.env_id}`**, {task.steps:,} decisions", ""]
        text += [f"| {' | '.join(titles)} |", "|---" * len(titles) + "|"]
        for run in found:
            cells = [
                f"`{run['learner']}`",
                str(len(run["seeds"])),
                in_brackets(earned(run)),
                in_three_digits(run["cpu"]),
            ]
            if (times := reached(run)) is not None:
                share = times / (task.steps * task.period)
                cells += [
                    in_brackets(times),
                    in_brackets(run["cpu"] * share),
                    f"{np.isfinite(times).sum()} of {len(times)}",
                ]
            text.append(f"| {' | '.join(cells)} |")
        text.append("")
    return "\n".join(text).rstrip()


def summary() -> str:
    """The best learner of ours and the best peer of every task by the median, in Markdown."""
    titles = ["task", "", "best of ours", "CPU s", "best peer", "CPU s", "runs"]
    lines = [f"| {' | '.join(titles)} |", "|---" * len(titles) + "|"]
    for name, task in TASKS.items():
        cells = [f"`{task.env_id}`", task.label]
        counts = []
        for group in (OURS, PEERS):
            runs = [run for run in stored(name) if run["learner"] in group]
            if not runs:
                cells = [*cells, "–", "–"]
                counts = [*counts, "–"]
                continue
            best = max(runs, key=lambda run: _median(earned(run)))
            cells += [f"`{best['learner']}` {in_brackets(earned(best))}", in_three_digits(best["cpu"])]
            counts.append(str(len(best["seeds"])))
        lines.append(f"| {' | '.join(cells)} | {', '.join(counts)} |")
    return "\n".join(lines)


def earned(run: dict[str, Any]) -> np.ndarray:
    """What each seed earned in the last tenth of the decisions; no apex is no hop, of 0 m."""
    return np.nan_to_num(np.array(run["curve"], float)[:, -POINTS // 10 :]).mean(axis=1)


def _median(values: np.ndarray) -> float:
    return float(np.quantile(values, 0.5, method="lower"))


def in_brackets(values: np.ndarray) -> str:
    """The median of the seeds, and the least and the greatest."""
    low, middle, high = (in_three_digits(v) for v in (np.min(values), _median(values), np.max(values)))
    return middle if len(values) == 1 else f"{middle} [{low} … {high}]"


def in_three_digits(value: float) -> str:
    """A number in three digits, without an exponent."""
    if np.isinf(value):
        return "never"
    text = f"{value:,.0f}" if abs(value) >= 100 else f"{value:.3g}"
    return text.replace("-", "−")


def main(arguments: list[str] | None = None) -> None:
    """Learn and store, or put the tables into their page."""
    parser = argparse.ArgumentParser(prog="python -m tools.streaming", description=(__doc__ or "").partition("\n")[0])
    commands = parser.add_subparsers(dest="command", required=True)
    learning = commands.add_parser("learn", help="train and store")
    learning.add_argument("task", choices=TASKS)
    learning.add_argument("--learner", choices=[*OURS, *PEERS], required=True)
    learning.add_argument("--seeds", type=int, default=None, help="how many, from --first; 10, or 3 of a peer")
    learning.add_argument("--first", type=int, default=0, help="the first seed; settings were chosen on 100 and above")
    learning.add_argument("--out", type=Path, default=DATA)
    commands.add_parser("table", help="put the tables into docs/streaming-table.md")
    given = parser.parse_args(arguments)
    if given.command == "table":
        page = PAGE.read_text(encoding="utf-8")
        for name, made in (("tables", tables), ("summary", summary)):
            between = rf"(<!-- {name} -->\n).*?(\n<!-- end -->)"
            page = re.sub(between, lambda at, made=made: at[1] + made() + at[2], page, flags=re.DOTALL)
        write_atomically(PAGE, page.encode())
        return
    task = TASKS[given.task]
    ours = given.learner in OURS
    seeds = list(range(given.first, given.first + (given.seeds or (10 if ours else 3))))
    work: Callable[[Task, str, list[int]], dict[str, Any]] = learn if ours else learn_peer
    machine = {key: value for key, value in provenance().items() if key != "command"}
    made = {"task": given.task, "learner": given.learner, "steps": task.steps, "seeds": seeds, "machine": machine}
    made |= work(task, given.learner, seeds)
    path = given.out / f"streaming-{given.task}--{given.learner}.json"
    text = json.dumps(made, default=lambda v: np.round(np.asarray(v, float), 5).tolist(), indent=1)
    write_atomically(path, f"{text}\n".encode())
    print(path, made["cpu"], made["curve"][:, -1], reached(made))


if __name__ == "__main__":
    main()
