"""The figures of MyoSuite: what is stored of learning its tasks, every seed, and the peers; and hindsight."""

import math

import jax.numpy as jnp
import numpy as np
from matplotlib.figure import Figure

import motorgrad as mg
from motorgrad.policies import abilities
from tools.figures._style import BLUE, COLOURS, FAINT, GREEN, ORANGE, RED, arrow, level, panels
from tools.figures._work import Work
from tools.myosuite import TASKS, stored

METRIC_LABELS = {"success": "successful episodes", "solved": "solved steps"}


def learning() -> Figure:
    """Shares of successful episodes and of solved steps while learning; of ours every seed, median and quartiles."""
    runs = stored()
    tasks = [name for name in TASKS if any(run["task"] == name for run in runs)]
    learners = list(dict.fromkeys(run["learner"] for run in runs))
    figure, axes = panels(len(METRIC_LABELS), 2.2 * len(tasks), len(tasks), squeeze=False, sharey=True)
    for row, task in zip(axes, tasks, strict=True):
        for panel, (reading, words) in zip(row, METRIC_LABELS.items(), strict=True):
            for run in (run for run in runs if run["task"] == task):
                round_, place = divmod(learners.index(run["learner"]), len(COLOURS))
                colour = COLOURS[place]
                dashes = ("-", "--")[round_]
                x = np.array(run["curves"]["steps"]) / 1000
                values = np.array(run["curves"][reading], float)
                if len(values) > 1:
                    panel.plot(x, values.T, color=colour, alpha=0.3, linewidth=0.5)
                    low, middle, high = np.nanpercentile(values, [25, 50, 75], axis=0)
                    panel.fill_between(x, low, high, color=colour, alpha=0.25, linewidth=0)
                    values = middle[None]
                panel.plot(x, values[0], color=colour, linestyle=dashes, linewidth=1.6, label=run["learner"])
            level(panel, 0.9, "")
            panel.set(title=f"{task}: {words}", xlabel="thousand decisions", ylim=(0, 1))
            lengths = [run["steps"] for run in runs if run["task"] == task]
            if max(lengths) > 4 * min(lengths):
                panel.set(xscale="log", xlim=(min(lengths) / 1e5, None))
    named = {label: line for panel in axes.flat for line, label in zip(*panel.get_legend_handles_labels(), strict=True)}
    figure.legend(named.values(), named.keys(), loc="outside upper center", ncols=math.ceil(len(named) / 2))
    return figure


def hindsight() -> Figure:
    """A movement that misses its target and reaches another place; and how the hand learns by it."""
    figure, (left, right) = panels(2, height=3.0, width_ratios=(1, 1.25))
    places = np.array([[0.02, 0.3], [0.03, 0.34], [0.06, 0.38], [0.11, 0.4], [0.17, 0.4], [0.22, 0.38]])
    moments = np.linspace(0, len(places) - 1, 60)
    way = np.stack([np.polyval(np.polyfit(range(len(places)), each, 4), moments) for each in places.T], axis=1)
    now = way[12]
    then = way[45]
    own = np.array([0.05, 0.44])
    left.plot(*way.T, color=FAINT)
    left.plot(*own, "o", color=RED, markersize=9, label="target of the episode")
    left.plot(*then, "o", color=GREEN, markersize=9, label="target in hindsight")
    for target, colour in ((own, RED), (then, GREEN)):
        arrow(left, now, target, colour, shrinkB=5)
    left.plot(*now, "o", color="0.2", markersize=5)
    left.annotate("$e_t$", (now + own) / 2, xytext=(-16, 0), textcoords="offset points", color=RED)
    left.annotate("$e_t - e_{t+k}$", (now + then) / 2, xytext=(0, -14), textcoords="offset points", color=GREEN)
    left.annotate("body", now, xytext=(8, -8), textcoords="offset points")
    left.set(xlabel="x (m)", ylabel="y (m)", aspect="equal", xlim=(-0.02, 0.26), ylim=(0.26, 0.5))
    left.legend(loc="upper right")
    learners = (
        ("sac-hindsight", "soft actor-critic with hindsight", GREEN),
        ("ppo-short-horizon-independent", "PPO", BLUE),
    )
    for learner, name, colour in learners:
        for run in (run for run in stored() if run["task"] == "hand" and run["learner"] == learner):
            values = 100 * np.array(run["curves"]["success"], float)
            for k, seed in enumerate(values):
                label = f"{name}, {len(values)} seed{'s' * (len(values) > 1)}" if k == 0 else None
                right.plot(np.array(run["curves"]["steps"]) / 1000, seed, color=colour, linewidth=1.2, label=label)
    level(right, 90, "")
    right.set(xlabel="thousand decisions", ylabel="successful episodes (%)", xscale="log", ylim=(0, 100))
    right.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), title="a hand with 39 muscles")
    return figure


def holding(work: Work) -> Figure:
    """The angle of an elbow that learned with noise that lasts, with a filtered mean action and with one as it is."""
    task = mg.tasks.myosuite(TASKS["elbow"][0], actions="continuous", scaling="none")
    steps = TASKS["elbow"][1]
    angle, error = (task.observation_names.index(name) for name in ("r_elbow_flex", "target error r_elbow_flex"))
    time = task.period * np.arange(100)
    figure, axes = panels(2, height=2.9, sharey=True)
    for panel, filtered, words in zip(axes, (True, False), ("filtered, as the noise is", "as it is"), strict=True):
        noise = {"policy.autocorrelation": 0.8, "policy.filtered": filtered}
        agent = mg.agent_for(task, noise, preset="sac", steps=steps)
        policy = work.train(task, agent, steps, 1, "elbow-filtered" if filtered else "elbow").policy(0)
        world = mg.environments.TaskEnv(task)
        starts = [(world.reset(seed=seed)[0], seed) for seed in range(12)]
        several = sorted((observation[angle] + observation[error], seed) for observation, seed in starts)[1::3]
        for (wanted, seed), colour in zip(several, (BLUE, RED, GREEN, ORANGE), strict=True):
            observation = world.reset(seed=seed)[0]
            memory = abilities.initial_memory(policy)
            path = []
            for _ in time:
                path.append(observation[angle])
                seen = abilities.observation_with_memory(policy, memory, jnp.asarray(observation))
                action = policy.mode(seen)
                memory = abilities.remember(policy, seen, action)
                observation = world.step(np.asarray(action))[0]
            panel.axhspan(wanted - 0.175, wanted + 0.175, color=colour, alpha=0.12, linewidth=0)
            panel.plot(time, path, color=colour, linewidth=1.3)
        panel.set(title=f"mean action {words}", xlabel="time (s)", xlim=(0, time[-1]))
    axes[0].set(ylabel="angle of the elbow (rad)")
    return figure
