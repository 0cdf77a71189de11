"""Section 7.3: a distribution over possible models of the environment, and policies improved under it."""

from collections.abc import Iterator
from typing import Any, ClassVar

import equinox as eqx
import jax
import numpy as np

from motorgrad.policies import Policy, softmax
from motorgrad.schema import count
from motorgrad.statistics import first_time, median_of
from motorgrad.tasks import Chain, FiniteTask, ThreeState
from motorgrad.training import agent_for, stepper_for
from motorgrad.worlds import FiniteMDP, TransitionPosterior, oracle
from motorgrad_thesis._claims import Claim, below
from motorgrad_thesis._experiment import Experiment, Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Figure, draw_band, new_figure

TASKS: dict[str, tuple[FiniteTask, float]] = {
    "three states": (ThreeState(), 3.0),
    "walk of 6": (Chain(), 3.0),
    "reset of 6": (Chain(variant="reset"), 3.0),
}
"""Tasks by name, with the learning rate of OLGARB: of eight from 0.01 to 30, the fastest at which ten of ten seeds
from 100 on reach the level."""

LEARNERS = {
    "free": ("OLGARB, without a model", "C1"),
    "mean": ("exact gradient in the mean model", "C2"),
    "sampled": ("mean over sampled models", "C0"),
}
STEP = 30.0  # size of each step in the models; of 3, 10, 30 and 100, on seeds from 100 on. 100 saves a batch at most
BATCH = 10  # decisions between two improvements by the models
ASCENTS = 10  # steps of each improvement
LEVEL = 0.95  # decisions are counted until this share of the best average reward


@experiment("sec-7.3-models", "a distribution over models", "section 7.3")
class Models(Experiment):
    """A softmax policy learns in three small worlds. After every ten decisions, a Dirichlet posterior over the
    transitions is brought up to date, and the policy takes ten steps up the exact gradient of the average reward: in
    the world of the mean transitions, or averaged over worlds drawn from the posterior. OLGARB learns without a model.
    The figure shows what the policies earn in the true world, computed by the oracle.
    """

    reading: ClassVar[str] = (
        "The thesis names the inference of a distribution over models as one Bayesian technique; the algorithm is "
        "ours. The models know the reward and the observation of every state beforehand, which OLGARB does not."
    )

    decisions: int = count(80, 2 * BATCH, 10**6, unit="decisions", help="length of learning with models")
    free: int = count(5_000, 2 * BATCH, 10**8, unit="decisions", help="length of learning without")
    models: int = count(3, 1, 1_000, help="worlds drawn from the posterior at every step of an improvement")
    seeds: int = count(20, 2, 10_000, help="number of learners of each kind")
    first: int = count(0, 0, 10**6, help="the first seed")

    quick = smoke(decisions=40, free=200, models=2, seeds=3)

    def run(self, work: Workspace) -> Values:
        found: Values = {}
        for name, (task, rate) in TASKS.items():
            best = oracle.best_memoryless(task.dynamics)[1]
            free = work.part(f"{name}-free".replace(" ", "-"), lambda task=task, rate=rate: self.without(task, rate))
            found |= {f"{name} free decision": free["decision"], f"{name} free": free["reward"] / best}
            for kind, models in (("mean", 0), ("sampled", self.models)):

                def make(task: FiniteTask = task, models: int = models) -> dict[str, Any]:
                    return {"reward": [self.with_models(task, models, seed) for seed in self._seeds]}

                made = work.part(f"{name}-{kind}".replace(" ", "-"), make)
                found[f"{name} {kind} decision"] = BATCH * np.arange(made["reward"].shape[1])
                found[f"{name} {kind}"] = made["reward"] / best
        return found

    @property
    def _seeds(self) -> range:
        return range(self.first, self.first + self.seeds)

    def without(self, task: FiniteTask, rate: float) -> dict[str, np.ndarray]:
        """Of OLGARB: decisions, and the exact average reward of every seed's policy at each, `(seeds, records)`."""
        agent = agent_for(task, estimator="olgarb", learning_rate=rate)
        stepper = stepper_for(task, agent, self._seeds)
        marks = np.unique(np.geomspace(BATCH, self.free, 40).astype(int))
        rows = [_earned(task.dynamics, stepper.policies(), self.seeds)]
        for mark in marks:
            stepper.advance(int(mark) - stepper.decision)
            rows.append(_earned(task.dynamics, stepper.policies(), self.seeds))
        return {"decision": np.concatenate([[0], marks]), "reward": np.array(rows).T}

    def with_models(self, task: FiniteTask, models: int, seed: int) -> list[float]:
        """The exact average reward after every `BATCH` decisions of one learner, which ascends in so many sampled
        models, or in the mean one if 0."""
        mdp = task.dynamics
        random = np.random.default_rng([seed, models])
        policy: Policy = softmax(task)
        belief = TransitionPosterior.of(mdp)
        state = mdp.start
        rewards = [oracle.average_reward(mdp, policy)]
        for _ in range(self.decisions // BATCH):
            chances = oracle.action_probabilities(mdp, policy)
            seen: list[tuple[int, int, int]] = []
            for _ in range(BATCH):
                action = int(random.choice(mdp.actions, p=chances[state] / chances[state].sum()))
                after = int(random.choice(mdp.states, p=mdp.transitions[action, state]))
                seen.append((state, action, after))
                state = after
            belief = belief.updated(*np.array(seen).T)
            for _ in range(ASCENTS):
                slope = belief.gradient(policy, random, models) if models else oracle.gradient(belief.mean(), policy)
                policy = _moved(policy, slope)
            rewards.append(oracle.average_reward(mdp, policy))
        return rewards

    def figure(self, values: Values) -> Figure:
        figure = new_figure(12, 3.8)
        for axes, name in zip(figure.subplots(1, len(TASKS), sharey=True), TASKS, strict=True):
            for kind, (label, colour) in LEARNERS.items():
                draw_band(axes, values[f"{name} {kind} decision"][1:], values[f"{name} {kind}"][:, 1:], colour, label)
            axes.axhline(LEVEL, color="0.6", linewidth=0.8, linestyle="--")
            axes.set(xscale="log", xlabel="decisions", title=name)
        figure.axes[0].set_ylabel("share of the best average reward")
        figure.axes[0].legend(loc="lower right", fontsize=8)
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        for name in TASKS:
            times = {}
            never = {}
            for kind in LEARNERS:
                decision = values[f"{name} {kind} decision"]
                reached = values[f"{name} {kind}"] >= LEVEL
                times[kind] = first_time(decision, reached, never=float(decision[-1]))
                never[kind] = int((~reached.any(axis=1)).sum())
            said = "; ".join(
                f"{LEARNERS[kind][0]}: median {np.median(times[kind]):,.0f}, {never[kind]} of {len(times[kind])} never"
                for kind in LEARNERS
            )
            for kind, words in (("mean", "in the mean model"), ("sampled", "averaged over sampled models")):
                statement = f"The gradient {words} needs fewer decisions than one without a model"
                yield below(
                    1,
                    f"{statement} ({name}).",
                    median_of(times[kind] / np.median(times["free"])),
                    f"decisions to {LEVEL:.0%} of the best average reward, relative to the median of OLGARB,",
                    "of the decisions",
                    note=f"{said}. Those who never reach it count with all their decisions.",
                    kind="extension",
                    of=f"{statement}.",
                )
            yield below(
                1,
                f"Sampled models need fewer decisions than their mean ({name}).",
                median_of(times["sampled"] / np.median(times["mean"])),
                f"decisions to {LEVEL:.0%} of the best average reward, relative to the median in the mean model,",
                "of the decisions",
                note=f"{said}.",
                kind="extension",
                of="Sampled models need fewer decisions than their mean.",
            )


def _earned(mdp: FiniteMDP, policies: Policy, seeds: int) -> list[float]:
    """The exact average reward of the policy of each seed."""
    return [
        oracle.average_reward(mdp, jax.tree.map(lambda leaf, seed=seed: leaf[seed], policies)) for seed in range(seeds)
    ]


def _moved(policy: Policy, slope: Policy) -> Policy:
    """The policy after a step along a gradient."""
    change = jax.tree.map(lambda leaf: np.asarray(STEP * leaf, np.float32), slope)
    return eqx.apply_updates(policy, change)
