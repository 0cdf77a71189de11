"""Learners on MyoSuite's tasks, side by side: `python -m tools.myosuite`, from the root of a checkout.

    python -m tools.myosuite learn elbow                 # our preset, ten seeds
    python -m tools.myosuite learn elbow --learner sac   # a peer with its published settings, one seed
    python -m tools.myosuite learn hand --learner natural-network --run runs/hand   # hours: to be continued if stopped
    python -m tools.myosuite table                       # put the table of all that is stored into docs/myosuite.md
    python -m tools.myosuite noise                       # how far noise of the muscles carries the hand's fingertips
    python -m tools.myosuite follow runs/hand            # how far the fingertips of a learned hand follow their targets

Each run is evaluated over 100 episodes with fresh targets, deterministic and drawn, and stored as one JSON file in
`docs/data`, from which the table and the figure are made.
"""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's compiled modules carry no type information.)

import argparse
import json
import math
import os
import re
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal

import gymnasium
import mujoco
import numpy as np

import motorgrad as mg
from motorgrad._files import write_atomically
from motorgrad._myosuite import environment, register
from motorgrad.learning import ProximalPolicyOptimization
from motorgrad.tasks._myosuite import NEAR
from motorgrad.training import agent_for, provenance

ROOT = Path(__file__).parents[1]
DATA = ROOT / "docs" / "data"
PAGE = ROOT / "docs" / "myosuite.md"
TASKS = {
    "elbow": ("myoElbowPose1D6MRandom-v0", 20_000),
    "finger": ("myoFingerPoseRandom-v0", 500_000),
    "hand": ("myoHandReachRandom-v0", 500_000),
}
"""Tasks by short name, with their budgets of decisions."""
OURS: dict[str, tuple[str, Literal["binary", "continuous"], dict[str, Any]]] = {
    "natural": ("natural", "binary", {}),
    "natural-network": ("natural-network", "continuous", {}),
    "natural-network-stored": ("natural-network", "continuous", {}),
    "ppo-short-horizon": ("ppo-short-horizon", "continuous", {}),
    "ppo-short-horizon-independent": ("ppo-short-horizon", "continuous", {"policy.autocorrelation": 0.0}),
    "sac-hindsight": ("sac", "continuous", {}),
}
"""Our learners: a preset, how muscles are driven, and changes to the preset."""
STORED = ("natural-network-stored",)
"""Learners that make one pass over every stored batch, with advantages computed backwards in it: a fifth less time than
as they come."""
UNSCALED = ("sac-hindsight",)
"""Learners that scale observations themselves: errors for other targets are those that MyoSuite would show."""
# of an evaluation; decisions of an episode
EPISODES = 100
LENGTH = 100
SUCCESSFUL = 5  # steps of an episode, more than which must be solved, as MyoSuite's evaluator counts
Mode = Literal["mode", "sample"]
MODES: tuple[Mode, ...] = ("mode", "sample")
PEERS: dict[str, tuple[str, dict[str, Any], str]] = {
    "ppo": ("PPO", {}, "Stable-Baselines3's defaults, as MyoSuite 3.0's `train_sb3.py` uses them"),
    "sac": ("SAC", {}, "Stable-Baselines3's defaults, as MyoSuite 3.0's `train_sb3.py` uses them"),
    "ppo-2": (
        "PPO",
        {
            "learning_rate": 1e-5,
            "batch_size": 256,
            "gamma": 0.95,
            "policy_kwargs": {"net_arch": {"pi": [256, 128], "vf": [256, 128]}},
        },
        "MyoSuite 2's `hydra_myo_sb3_ppo_config.yaml`, which is meant for 15 million steps",
    ),
    "sac-2": (
        "SAC",
        {
            "learning_rate": 7.3e-4,
            "buffer_size": 300_000,
            "learning_starts": 3_000,
            "batch_size": 256,
            "tau": 0.02,
            "gamma": 0.98,
        },
        "MyoSuite 2's `hydra_myo_sb3_sac_config.yaml`, which is meant for 15 million steps",
    ),
}
"""Peers: class of Stable-Baselines3, published settings, and where they are published."""


class Clock:
    """Wall and processor seconds since it was made, of all threads."""

    def __init__(self) -> None:
        self._start = self._now()

    @staticmethod
    def _now() -> tuple[float, float]:
        return time.perf_counter(), time.process_time()

    def read(self) -> dict[str, float]:
        return {name: now - then for name, now, then in zip(("wall", "cpu"), self._now(), self._start, strict=True)}


def from_stored_batches(agent: Any) -> ProximalPolicyOptimization:
    """The learner that makes the steps of a policy gradient from batches that it stores."""
    estimator = agent.estimator
    return ProximalPolicyOptimization(
        agent.policy,
        estimator.baseline,
        estimator.trace.decay,
        estimator.update_every,
        clip=0.2,
        epochs=1,
        entropy=estimator.entropy,
        normalization=estimator.normalization,
        reward_scaling=estimator.reward_scaling,
        optimizer=agent.optimizer,
        metric=agent.metric,
        averaging=agent.averaging,
    )


def learn(name: str, learner: str, steps: int, seeds: list[int], threads: int, out: Path | None) -> dict[str, Any]:
    """A learner of ours on a rebuilt task; kept in the directory `out`, from which it continues if it was stopped."""
    preset, actions, changes = OURS[learner]
    scaling = "none" if learner in UNSCALED else "running"
    task = mg.tasks.myosuite(TASKS[name][0], actions=actions, scaling=scaling)
    agent = agent_for(task, changes, preset=preset, steps=steps)
    agent = from_stored_batches(agent) if learner in STORED else agent
    run = mg.train(task, agent, steps, seeds, out, window=max(1, steps // 40), threads=threads, progress=False)
    if not run.complete:
        raise SystemExit(f"stopped after {run.decision:,} of {steps:,} decisions: nothing is stored")
    # of all sessions in which the run learned
    took = {clock: float(run.metrics[f"{clock}_time"][-1].as_py()) for clock in ("wall", "cpu")}
    curves: dict[str, Any] = {}
    for reading in ("success", "solved"):
        x, curves[reading] = run.curve(reading)
        curves["steps"] = x
    found: dict[Mode, Any] = {mode: mg.evaluate(run, EPISODES * LENGTH, mode=mode, threads=threads) for mode in MODES}
    evaluated = {mode: {key: found[mode].metrics[key] for key in ("success", "solved")} for mode in MODES}
    return {"took": took, "settings": run.config["agent"], "curves": curves, "evaluated": evaluated}


def learn_peer(name: str, learner: str, steps: int, seed: int, threads: int) -> dict[str, Any]:
    """A peer on MyoSuite's own environment."""
    import stable_baselines3  # pyright: ignore[reportMissingImports]
    import torch  # pyright: ignore[reportMissingImports]

    register()
    torch.set_num_threads(threads or os.cpu_count() or 1)
    kind, settings, _ = PEERS[learner]
    environment = gymnasium.make(TASKS[name][0])
    clock = Clock()
    watched = _Watched(environment)
    model = getattr(stable_baselines3, kind)("MlpPolicy", watched, seed=seed, device="cpu", **settings)
    model.learn(steps)
    took = clock.read()
    evaluated: dict[str, Any] = {}
    for mode in MODES:
        trial = _Watched(gymnasium.make(TASKS[name][0]))
        observation, _ = trial.reset(seed=seed + 1_000_000)
        while len(trial.solved) < EPISODES:
            action, _ = model.predict(observation, deterministic=mode == "mode")
            observation, _, terminated, truncated, _ = trial.step(action)
            if terminated or truncated:
                observation, _ = trial.reset()
        steps_solved = np.array(trial.solved)
        evaluated[mode] = {"success": [(steps_solved > SUCCESSFUL).mean()], "solved": [steps_solved.mean() / LENGTH]}
    solved = np.array(watched.solved)
    width = max(1, len(solved) // 40)
    blocks = [part for part in np.split(solved, range(width, len(solved), width)) if len(part)]
    curves = {
        "steps": LENGTH * np.cumsum([len(part) for part in blocks]),
        "success": [[(part > SUCCESSFUL).mean() for part in blocks]],
        "solved": [[part.mean() / LENGTH for part in blocks]],
    }
    return {"took": took, "settings": settings, "curves": curves, "evaluated": evaluated}


class _Watched(gymnasium.Wrapper):
    """Counts the solved steps of each episode that has ended."""

    def __init__(self, environment: gymnasium.Env):
        super().__init__(environment)
        self.solved: list[int] = []
        self._now = 0

    def reset(self, **kwargs: Any) -> Any:
        self._now = 0
        return super().reset(**kwargs)

    def step(self, action: Any) -> Any:
        result = super().step(action)
        self._now += bool(result[4]["solved"])
        if result[2] or result[3]:
            self.solved.append(self._now)
        return result


def stored() -> list[dict[str, Any]]:
    """All stored runs, by task, ours first. Runs of the same learner with other seeds are joined."""
    found: dict[tuple[str, str, int], dict[str, Any]] = {}
    for path in sorted(DATA.glob("myosuite-*.json")):
        run = json.loads(path.read_text(encoding="utf-8"))
        key = run["task"], run["learner"], run["steps"]
        found[key] = _joined(found[key], run) if key in found else run
    names = [*TASKS]
    order = lambda run: (names.index(run["task"]), run["learner"] not in OURS, run["learner"], run["steps"])  # noqa: E731
    return sorted(found.values(), key=order)


def _joined(one: dict[str, Any], other: dict[str, Any]) -> dict[str, Any]:
    """A run of the seeds of both."""
    rows = {key: one["curves"][key] + other["curves"][key] for key in ("success", "solved")}
    evaluated = {
        mode: {key: values + other["evaluated"][mode][key] for key, values in each.items()}
        for mode, each in one["evaluated"].items()
    }
    took = {clock: seconds + other["took"][clock] for clock, seconds in one["took"].items()}
    seeds = one["seeds"] + other["seeds"]
    return {**one, "seeds": seeds, "took": took, "curves": {**one["curves"], **rows}, "evaluated": evaluated}


def table() -> str:
    """The table of all stored runs, in Markdown."""
    titles = ["task", "learner", "steps per seed", "wall s, all seeds", "CPU s per seed", "success", "success, drawn"]
    titles += ["solved steps", "solved steps, drawn", "seeds with ≥ 90 % success"]
    lines = [f"| {' | '.join(titles)} |", "|---" * len(titles) + "|"]
    for run in stored():
        seeds = len(run["seeds"])
        each = run["evaluated"]
        passed = sum(value >= 0.9 for value in each["mode"]["success"])
        cells = [run["task"], f"`{run['learner']}`", f"{run['steps']:,}"]
        cells += [f"{run['took']['wall']:,.0f}", f"{run['took']['cpu'] / seeds:,.0f}"]
        cells += [_percent(each[mode][key]) for key in ("success", "solved") for mode in MODES]
        lines.append(f"| {' | '.join(cells)} | {passed} of {seeds} |")
    return "\n".join(lines)


def _percent(values: list[float]) -> str:
    """The median of the seeds, and the worst and the best."""
    low, middle, high = (100 * f(values) for f in (np.min, np.median, np.max))
    return f"{middle:.0f} %" if len(values) == 1 else f"{middle:.0f} % [{low:.0f} … {high:.0f}]"


def with_table(page: str) -> str:
    """The page with the table in its place."""
    return re.sub(r"(<!-- table -->\n).*?(\n<!-- end -->)", lambda at: at[1] + table() + at[2], page, flags=re.DOTALL)


def carried(deviation: float, autocorrelation: float, tones: int = 10, draws: int = 6, seed: int = 100) -> np.ndarray:
    """How far noise of the muscles carries the fingertips of MyoSuite's hand, in m, at each of so many muscle tones.

    The muscles act around a tone that is drawn once, by squashed units of this deviation and autocorrelation. The
    distance is the deviation over the draws, as a root of summed squares over the fingertips like the task's, in the
    second half of 0.8 s.
    """
    given = environment(TASKS["hand"][0])
    random = np.random.default_rng(seed)
    model = given.model
    data = mujoco.MjData(given.model)
    tips = [model.site(name).id for name in given.target_reach_range]
    around = 0.7 * random.normal(size=(tones, model.nu))

    def path(tone: np.ndarray) -> np.ndarray:
        mujoco.mj_resetData(model, data)
        noise = deviation * random.normal(size=model.nu)
        places = []
        for _ in range(40):
            fresh = deviation * random.normal(size=model.nu)
            noise = autocorrelation * noise + math.sqrt(1 - autocorrelation**2) * fresh
            data.ctrl[:] = 1 / (1 + np.exp(-5 * (np.tanh(tone + noise) - 0.5)))
            mujoco.mj_step(model, data, given.frame_skip)
            places.append(data.site_xpos[tips].ravel())
        return np.array(places[20:])

    paths = np.array([[path(tone) for _ in range(draws)] for tone in around])
    return np.sqrt(paths.var(axis=1, ddof=1).sum(axis=-1).mean(axis=-1))


def noise_table() -> str:
    """How far noise of the muscles carries the hand's fingertips, in cm, median over tones and range, in Markdown."""
    lags = (0.0, 0.8, 0.9)
    deviations = (0.1, 0.3, 1.0)
    titles = ["autocorrelation", *(f"deviation {each:g}" for each in deviations)]
    lines = [f"| {' | '.join(titles)} |", "|---" * len(titles) + "|"]
    for lag in lags:
        found = [100 * carried(each, lag) for each in deviations]
        cells = [f"{np.median(each):.1f} [{each.min():.1f} … {each.max():.1f}]" for each in found]
        lines.append(f"| {lag:g} | {' | '.join(cells)} |")
    return "\n".join(lines)


def within_reach(targets: np.ndarray, places: np.ndarray) -> float:
    """The share of targets, (draws, fingertips, 3) in m, that are within the task's tolerance of the `places` of the
    fingertips, of each draw or the same for all. Distances are a root of summed squares over the fingertips."""
    distances = np.sqrt(np.square(targets - places).sum(axis=(-1, -2)))
    return float((distances < NEAR * targets.shape[1]).mean())


def follow_table(directory: Path, episodes: int = 200, decision: int = 60) -> str:
    """How far each fingertip of a run's first seed moves per metre of its target, in m, by least squares at a decision
    of fresh episodes with the most probable actions; and the share of targets within reach. In Markdown."""
    given = environment(TASKS["hand"][0])
    run = mg.load(directory)
    if run.task.action_size != given.model.nu:
        raise SystemExit(f"{directory} has {run.task.action_size} actions: it must be a run that learned the hand")
    found = mg.evaluate(run, LENGTH * episodes, mode="mode")
    assert found.marks is not None
    assert found.sensors is not None
    chosen = slice(decision, None, LENGTH)
    targets = found.marks[0, chosen, :, :3]
    places = [found.sensors[f"framepos of site {name}"][0, chosen] for name in given.target_reach_range]
    tip = np.stack(places, axis=1)
    off = targets - targets.mean(axis=0)
    slopes = (off * (tip - tip.mean(axis=0))).sum(axis=0) / np.square(off).sum(axis=0)
    lines = ["| fingertip | x | y | z |", "|---|---|---|---|"]
    rows = zip(given.target_reach_range, slopes, strict=True)
    lines += [f"| {name} | {' | '.join(f'{each:.2f}' for each in row)} |" for name, row in rows]
    reached, still = (within_reach(targets, where) for where in (tip, targets.mean(axis=0)))
    lines += ["", f"Within reach: {reached:.0%}; of fingertips that rest at the middle of the targets: {still:.0%}"]
    return "\n".join(lines)


def main(arguments: list[str] | None = None) -> None:
    """Learn and store, put the table into its page, or print how far noise carries or fingertips follow."""
    parser = argparse.ArgumentParser(prog="python -m tools.myosuite", description=(__doc__ or "").partition("\n")[0])
    commands = parser.add_subparsers(dest="command", required=True)
    learning = commands.add_parser("learn", help="train, evaluate and store")
    learning.add_argument("task", choices=TASKS)
    learning.add_argument("--learner", choices=[*OURS, *PEERS], default="natural")
    learning.add_argument("--seeds", type=int, default=None, help="how many, from --first; 10, or 1 of a peer")
    learning.add_argument("--first", type=int, default=0, help="the first seed; settings were chosen on 100 and above")
    learning.add_argument("--steps", type=int, default=None, help="per seed; by default the task's budget")
    learning.add_argument("--threads", type=int, default=0, help="0 for one per processor")
    learning.add_argument("--run", type=Path, default=None, help="directory of our run, which continues there")
    learning.add_argument("--out", type=Path, default=DATA)
    commands.add_parser("table", help="put the table into docs/myosuite.md")
    commands.add_parser("noise", help="print how far noise of the muscles carries the hand's fingertips")
    following = commands.add_parser(
        "follow", help="print how far the fingertips of a learned hand follow their targets"
    )
    following.add_argument("run", type=Path, help="directory of a run that learned the hand")
    given = parser.parse_args(arguments)
    if given.command == "follow":
        print(follow_table(given.run))
        return
    if given.command == "table":
        write_atomically(PAGE, with_table(PAGE.read_text(encoding="utf-8")).encode())
        return
    if given.command == "noise":
        print(noise_table())
        return
    steps = given.steps or TASKS[given.task][1]
    ours = given.learner in OURS
    seeds = list(range(given.first, given.first + (given.seeds or (10 if ours else 1))))
    work: Callable[[], dict[str, Any]] = (
        (lambda: learn(given.task, given.learner, steps, seeds, given.threads, given.run))
        if ours
        else (lambda: learn_peer(given.task, given.learner, steps, seeds[0], given.threads))
    )
    made = {"task": given.task, "env_id": TASKS[given.task][0], "learner": given.learner, "steps": steps}
    machine = {key: value for key, value in provenance().items() if key != "command"}
    made |= {"seeds": seeds, "episodes": EPISODES, "machine": machine, **work()}
    given.out.mkdir(parents=True, exist_ok=True)
    named = ["myosuite", given.task, given.learner]
    named += [f"{steps}"] if steps != TASKS[given.task][1] else []
    named += [f"from-{given.first}"] if given.first else []
    path = given.out / f"{'-'.join(named)}.json"
    write_atomically(path, (json.dumps(made, default=_plain, indent=1) + "\n").encode())
    print(
        path, {mode: {key: _percent(v) for key, v in made["evaluated"][mode].items()} for mode in MODES}, made["took"]
    )


def _plain(value: Any) -> Any:
    """An array as a list of short numbers."""
    return np.round(np.asarray(value, float), 5).tolist()


if __name__ == "__main__":
    main()
