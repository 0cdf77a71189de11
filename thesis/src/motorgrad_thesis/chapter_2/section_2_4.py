"""Section 2.4: where learning values succeeds and where it fails, on a world of three states."""

from collections.abc import Iterator, Sequence
from typing import ClassVar

import numpy as np
from jaxtyping import Float, Int

from motorgrad.policies import Softmax
from motorgrad.schema import count, number
from motorgrad.statistics import exact, mean_of, share_of
from motorgrad.worlds import FiniteMDP, load_unload, oracle, three_state
from motorgrad_thesis._claims import Claim, above, at_least, below
from motorgrad_thesis._experiment import Experiment, Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Axes, Figure, draw_intervals, subplots

RECORDS = 200
PLACES = 3  # of the line on which a load is carried
SHORT = 0.9  # a discount with which the approximate values converge
HUGE = 1e6  # weights from here on count as diverged
BEST = 1e-3  # a policy is the best if it earns the most reward within this
ASCENT = 10.0  # step size of the exact policy gradient, whose largest entry is about 0.1
TABLE = "#3b6fb6"
LINEAR = "#c8452f"
POLICY = "#2a8c4a"


@experiment("sec-2.4-values", "learning values", "section 2.4")
class LearnedValues(Experiment):
    """Q-learning (Watkins, 1989) from actions at random: with a table on a world of three states; on the same world
    with the two features of each state that its policies observe; and on a line where a load is carried and not seen.
    Left: the greatest weight of the approximate values by exact expected updates, for several discounts, and from
    samples. Middle: the average reward of the greedy policy on the three states, and that of a policy with the same
    features which climbs the exact gradient. Right: the same on the line.
    """

    reading: ClassVar[str] = (
        '"Fail catastrophically (diverging from an optimal value-function)" is read as weights that grow without '
        "bound. The text names no method, world or settings. Q-learning is the best known of the methods that it "
        "describes, and the three states are those of Baxter and Bartlett (2001), on which the thesis compares "
        "gradients."
    )

    seeds: int = count(20, 2, 10_000, help="number of learners from samples, for each world and representation")
    steps: int = count(40_000, RECORDS, 10**8, unit="decisions", help="of each of them")
    updates: int = count(40_000, RECORDS, 10**8, help="number of exact expected updates")
    discount: float = number(0.95, 0, 1, open_high=True, help="of future rewards, per decision")
    rate: float = number(0.1, 0, 1, open_low=True, help="step size of every update of values")
    ascent: int = count(400, 10, 10**6, help="steps along the exact policy gradient")

    quick = smoke(seeds=2, steps=400, updates=400, ascent=10)

    def run(self, work: Workspace) -> Values:
        world = three_state()
        line = load_unload(PLACES)
        kinds = np.eye(world.states), world.observations
        found: Values = {"discounts": np.array([0.5, SHORT, self.discount])}
        found["growth"] = np.array([growth(world, discount) for discount in found["discounts"]])
        found |= work.part("expected", lambda: self._expected(world))
        for name, mdp, features in (("table", world, kinds[0]), ("linear", world, kinds[1])):
            found |= work.part(name, lambda n=name, m=mdp, f=features: self._sampled(n, m, f))
        found |= work.part("hidden", lambda: self._sampled("hidden", line, line.observations))
        for name, mdp in (("policy", world), ("policy hidden", line)):
            found |= work.part(name, lambda n=name, m=mdp: {n: climb(m, self.ascent)})
        return found | {
            "best": np.array(oracle.optimal_policy(world)[1]),
            "best hidden": np.array(oracle.best_memoryless(line)[1]),
        }

    def _expected(self, world: FiniteMDP) -> Values:
        """The greatest weight, and the average reward of the greedy policy, `(discounts, records)`."""
        discounts = (0.5, SHORT, self.discount)
        paths = [expected_updates(world, each, self.rate, self.updates) for each in discounts]
        return {
            "expected weight": np.abs(paths).max(axis=(2, 3)),
            "expected reward": np.array([_earned(world, world.observations, path[None])[0] for path in paths]),
        }

    def _sampled(self, name: str, world: FiniteMDP, features: Float[np.ndarray, "states features"]) -> Values:
        """The same from samples, `(seeds, records)`."""
        path = sampled_updates(world, features, self.discount, self.rate, self.steps, self.seeds)
        return {f"{name} weight": np.abs(path).max(axis=(2, 3)), f"{name} reward": _earned(world, features, path)}

    def figure(self, values: Values) -> Figure:
        figure, (left, middle, right) = subplots(13, 4, columns=3)
        _draw_weights(left, values, self.updates, self.steps)
        decisions = np.linspace(0, self.steps, RECORDS + 1)[1:] / 1000
        for name, colour, label in (("table", TABLE, "Q-learning, table"), ("linear", LINEAR, "Q-learning, features")):
            _draw_reward(middle, decisions, values[f"{name} reward"], colour, label)
        _draw_reward(right, decisions, values["hidden reward"], LINEAR, "Q-learning")
        for axes, ends, title in (
            (middle, ("policy", "best"), "three states"),
            (right, ("policy hidden", "best hidden"), "a load that is not seen"),
        ):
            reached, best = (values[each] for each in ends)
            axes.axhline(reached[-1], color=POLICY, label="policy gradient, in the end")
            axes.axhline(best, color="0.3", linestyle=":", label="best policy of its kind")
            axes.set(
                xlabel="decisions (thousands)", ylabel="average reward", title=title, ylim=(-0.02 * best, 1.3 * best)
            )
            axes.legend(loc="center right", fontsize=9)
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        best = float(values["best"])
        table = values["table reward"][:, -1] > best - BEST
        yield above(
            0.8,
            "With a table and Markovian observations Q-learning finds the globally optimal policy.",
            share_of(table),
            unit="of seeds",
            note=f"On three states, after {self.steps:,} decisions at random; the best policy earns {best:.2g}.",
        )
        yield from _divergence_claims(values, self.discount, self.seeds)
        yield from _hidden_claims(values)
        yield at_least(
            best - BEST,
            "On the same world with the same features, the policy gradient converges to the best policy.",
            exact(float(values["policy"][-1])),
            unit="average reward",
            source="sections 2.4 and 2.5.2",
            note="By exact gradients, from equal probabilities of both actions.",
        )
        yield below(
            0.5 * best,
            "Features that represent the best policy may have values whose greedy policy is among the worst.",
            exact(float(values["expected reward"][1, -1])),
            unit="average reward",
            kind="extension",
            note=f"At the discount {SHORT:g} the expected updates converge, and the greedy policy goes the wrong way "
            f"from every state. The policy gradient earns {values['policy'][-1]:.2g} with these features.",
        )


DIVERGES = "With approximate values, learning can diverge even in small worlds."


def _divergence_claims(values: Values, discount: float, seeds: int) -> Iterator[Claim]:
    yield above(
        0,
        DIVERGES,
        exact(float(values["growth"][-1])),
        unit="growth of the weights per unit of step size",
        note=f"The greatest real part of an eigenvalue of the expected update at the discount {discount:g}, while the "
        "same action is greedy everywhere; so smaller steps only delay it. Three states, two features, actions at "
        "random.",
    )
    weights = values["linear weight"][:, -1]
    bound = 10.0 / (1.0 - discount)  # ten times what any policy can earn
    yield above(
        0.8,
        "So it does from samples.",
        share_of(weights > bound),
        unit="of seeds",
        of=DIVERGES,
        note=f"A weight beyond {bound:g}, ten times the greatest possible value; the median of {seeds} seeds is "
        f"{np.median(weights):.2g}.",
    )


def _hidden_claims(values: Values) -> Iterator[Claim]:
    best = float(values["best hidden"])
    yield below(
        0.1 * best,
        "Where the task is partially observable, learning values can fail.",
        mean_of(values["hidden reward"][:, -1]),
        unit="average reward",
        note=f"The greedy policy on a line of {PLACES} places, where a load is carried and not seen: with one action "
        "for each observation it never goes from one end to the other and back. The best policy that acts on the "
        f"observation earns {best:.3g}, by acting at random between the ends.",
    )
    yield at_least(
        0.99 * best,
        "The policy gradient applies there.",
        exact(float(values["policy hidden"][-1])),
        unit="average reward",
        source="section 2.5",
        note="By exact gradients.",
    )


def expected_updates(
    world: FiniteMDP, discount: float, rate: float, updates: int
) -> Float[np.ndarray, "records actions features"]:
    r"""Weights under the mean update of linear Q-learning with actions at random, $\alpha\,\mathbb E[(r + \gamma \max_b
    w_b \cdot \phi(s') - w_a \cdot \phi(s))\,\phi(s)]$, from 0. They stay where one is `HUGE`."""
    weights = np.zeros((world.actions, world.observations.shape[1]))
    visits = _visits(world)
    rewards = world.expected_rewards
    path = []
    for update in range(1, updates + 1):
        if np.abs(weights).max() < HUGE:
            worth = weights @ world.observations.T
            errors = rewards + discount * world.transitions @ worth.max(0) - worth
            weights = weights + rate * (errors * visits / world.actions) @ world.observations
        if update % (updates // RECORDS) == 0:
            path.append(weights)
    return np.array(path[:RECORDS])


def growth(world: FiniteMDP, discount: float) -> float:
    """The greatest real part of an eigenvalue of the expected update, by the worst action that is greedy in all
    states: positive where weights grow without bound while it stays so."""
    features = world.observations
    size = world.actions * features.shape[1]
    visits = np.diag(_visits(world) / world.actions)
    found = []
    for greedy in range(world.actions):
        matrix = np.zeros((world.actions, features.shape[1], world.actions, features.shape[1]))
        for action in range(world.actions):
            matrix[action, :, action] -= features.T @ visits @ features
            matrix[action, :, greedy] += discount * features.T @ visits @ world.transitions[action] @ features
        found.append(np.linalg.eigvals(matrix.reshape(size, size)).real.max())
    return max(found)


def sampled_updates(
    world: FiniteMDP,
    features: Float[np.ndarray, "states features"],
    discount: float,
    rate: float,
    steps: int,
    seeds: int,
) -> Float[np.ndarray, "seeds records actions features"]:
    """Weights of linear Q-learning from one stream for each seed, with actions at random, from 0. A table is linear in
    one feature for each state."""
    each = np.arange(seeds)
    draws = [np.random.default_rng(seed) for seed in range(seeds)]
    actions = np.stack([draw.integers(world.actions, size=steps) for draw in draws])
    chances = np.stack([draw.random(steps) for draw in draws])
    ends = np.cumsum(world.transitions, axis=-1)
    by_entry = world.rewards.ndim == 1
    weights = np.zeros((seeds, world.actions, features.shape[1]))
    states = np.full(seeds, world.start)
    path = []
    for step in range(steps):
        action = actions[:, step]
        after = np.minimum((chances[:, step, None] >= ends[action, states]).sum(1), world.states - 1)
        reward = world.rewards[after] if by_entry else world.rewards[action, states]
        ahead = np.einsum("kaf,kf->ka", weights, features[after]).max(1)
        error = reward + discount * ahead - np.sum(weights[each, action] * features[states], axis=1)
        error[np.abs(weights).max(axis=(1, 2)) > HUGE] = 0.0
        weights[each, action] += rate * error[:, None] * features[states]
        states = after
        if (step + 1) % (steps // RECORDS) == 0:
            path.append(weights.copy())
    return np.stack(path[:RECORDS], axis=1)


def climb(world: FiniteMDP, steps: int) -> Float[np.ndarray, " steps"]:
    """The average reward of a softmax policy of the world's observations that climbs its exact gradient, from equal
    probabilities."""
    policy = Softmax(np.zeros((world.actions, world.observations.shape[1])))
    earned = []
    for _ in range(steps):
        slope = oracle.gradient(world, policy)
        policy = Softmax(np.asarray(policy.weights) + ASCENT * np.asarray(slope.weights))
        earned.append(oracle.average_reward(world, policy))
    return np.array(earned)


def _visits(world: FiniteMDP) -> Float[np.ndarray, " states"]:
    """How often a policy that acts at random is in each state."""
    return oracle.stationary_distribution(world, Softmax(np.zeros((world.actions, world.observations.shape[1]))))


def _earned(
    world: FiniteMDP, features: Float[np.ndarray, "states features"], path: Float[np.ndarray, "seeds records a f"]
) -> Float[np.ndarray, "seeds records"]:
    """The average reward of the greedy policies; of equal actions the first is taken."""
    greedy = np.einsum("kraf,sf->krsa", path, features).argmax(-1)
    kinds, kind = np.unique(greedy.reshape(-1, world.states), axis=0, return_inverse=True)
    return np.array([_gain(world, each) for each in kinds])[kind.ravel()].reshape(greedy.shape[:2])


def _gain(world: FiniteMDP, choice: Int[np.ndarray, " states"] | Sequence[int]) -> float:
    return oracle.average_reward(world, choice)


def _draw_weights(axes: Axes, values: Values, updates: int, steps: int) -> None:
    at = np.linspace(0, updates, RECORDS + 1)[1:] / 1000
    for weights, discount, shade in zip(values["expected weight"], values["discounts"], (0.75, 0.5, 0.0), strict=True):
        axes.plot(at, weights, color=f"{shade}", label=f"expected, discount {discount:g}")
    sampled = np.linspace(0, steps, RECORDS + 1)[1:] / 1000
    lines = axes.plot(sampled, values["linear weight"].T, color=LINEAR, linewidth=0.6, alpha=0.6, zorder=0)
    lines[0].set_label(f"from samples, {values['discounts'][-1]:g}")
    axes.set(xlabel="updates (thousands)", ylabel="greatest weight", yscale="log", title="features")
    axes.legend(fontsize=9, loc="center right", bbox_to_anchor=(1, 0.4))


def _draw_reward(axes: Axes, decisions: np.ndarray, rewards: np.ndarray, colour: str, label: str) -> None:
    axes.plot(decisions, rewards.mean(0), color=colour, label=label)
    some = np.arange(RECORDS // 10 - 1, RECORDS, RECORDS // 10)
    draw_intervals(axes, decisions[some], [mean_of(rewards[:, each]) for each in some], fmt="none", ecolor=colour)
