"""Finite Markov decision processes: small worlds for which the oracle has exact answers."""

import itertools
from collections.abc import Sequence
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import numpy.typing as npt
from jaxtyping import Array, Float, Int

from motorgrad._errors import check, check_integer, choice
from motorgrad.policies import SigmoidUnits, fixed
from motorgrad.worlds._world import World

CHAIN_VARIANTS = ("walk", "reset")
"""The effect of a wrong move: one state back, or back to the start."""


class FiniteMDP(World):
    """A finite MDP whose observation is a function of the state.

    The arrays are NumPy float64, exact for the oracle (see `motorgrad.worlds.oracle`). Sampling runs in the learner's
    precision, on the few possible successors of each state.

    **Arguments:**

    - `transitions`: `(actions, states, states)`, rows sum to one.
    - `rewards`: `(states,)`, received on entering a state; or `(actions, states)`, received for an action in a state.
    - `observations`: `(states, inputs)`, what the policy observes.
    - `start`: the initial state of an episode.

    **Raises:** `ValueError` for arrays of other shapes, rows that are not probabilities (to 1e-12), or an invalid
    start.
    """

    uniforms: ClassVar[int] = 1

    def __init__(
        self, transitions: npt.ArrayLike, rewards: npt.ArrayLike, observations: npt.ArrayLike, start: int = 0
    ) -> None:
        self.transitions = np.asarray(transitions, float)
        self.rewards = np.asarray(rewards, float)
        self.observations = np.asarray(observations, float)
        self.start = start
        shape = self.transitions.shape
        check(len(shape) == 3 and shape[1] == shape[2], "transitions", shape, "of shape (actions, states, states)")
        states = shape[1]
        shapes = ((states,), shape[:2])
        check(self.rewards.shape in shapes, "rewards", self.rewards.shape, f"of shape {shapes[0]} or {shapes[1]}")
        seen = self.observations.shape
        check(len(seen) == 2 and seen[0] == states, "observations", seen, f"of shape ({states}, inputs)")
        check(0 <= start < states, "start", start, f"a state from 0 to {states - 1}")
        for name in ("rewards", "observations"):
            check(np.isfinite(getattr(self, name)).all(), name, getattr(self, name).tolist(), "finite numbers")
        low = self.transitions.min()
        off = np.abs(self.transitions.sum(-1) - 1).max()
        check(low >= 0 and off < 1e-12, "transitions", f"least {low}, row sums off by {off}", "probabilities")
        self._successors, self._cumulative = _compact(self.transitions)

    @property
    def states(self) -> int:
        """Number of states."""
        return self.transitions.shape[1]

    @property
    def actions(self) -> int:
        """Number of actions."""
        return self.transitions.shape[0]

    def reset(self, uniforms: Float[Array, " 0"]) -> Int[Array, ""]:
        del uniforms
        return jnp.asarray(self.start, jnp.int32)

    def step(self, state: Int[Array, ""], action: Array, uniforms: Float[Array, " 1"]) -> Int[Array, ""]:
        """The next state. `action` is the action's index, or a vector of bits that spell it (most significant
        first)."""
        index = action_index(action)
        # The last successor needs no comparison, so rounding cannot lead outside the list.
        row = jnp.asarray(self._cumulative, uniforms.dtype)[index, state, :-1]
        which = jnp.sum(uniforms[0] >= row, dtype=jnp.int32)
        return jnp.asarray(self._successors)[index, state, which]

    def reward(self, before: Int[Array, ""], action: Array, after: Int[Array, ""]) -> Float[Array, ""]:
        """The reward for the step from `before` to `after` by `action`."""
        rewards = jnp.asarray(self.rewards, jnp.result_type(float))
        return rewards[after] if rewards.ndim == 1 else rewards[action_index(action), before]

    @property
    def expected_rewards(self) -> Float[np.ndarray, "actions states"]:
        """The mean reward of each action in each state."""
        return self.rewards if self.rewards.ndim == 2 else self.transitions @ self.rewards


def three_state() -> FiniteMDP:
    """The three-state, two-action MDP of Baxter & Bartlett (2001, section 4.1), on which gradient estimators are
    compared.

    Only state C is rewarded. Action 0 leads towards B from A and C, action 1 towards C. Each state has two features, so
    the policy cannot distinguish every state freely. The best policy earns 0.8.
    """
    first = [[0, 0.8, 0.2], [0.8, 0, 0.2], [0, 0.8, 0.2]]
    second = [[0, 0.2, 0.8], [0.2, 0, 0.8], [0, 0.2, 0.8]]
    features = np.array([[12, 6], [6, 12], [5, 5]]) / 18
    return FiniteMDP([first, second], [0, 0, 1], features)


def chain(length: int = 6, variant: str = "walk") -> FiniteMDP:
    """The chain of figure 4.9: reward only at its far end.

    A line of `length` $= N$ states with actions left (0) and right (1), observed one-hot. Entering its right end is
    rewarded with 1; from there either action leads back to the start.

    The thesis calls the time to the first reward under random actions exponential. That depends on the effect of a
    wrong move, so there are two variants:

    - `"walk"`: left is one state back. Random actions take $N(N - 1)$ steps on average (30 for $N = 6$).
    - `"reset"`: left is back to the start. Random actions take $2^N - 2$ steps (62): exponentially many.

    With episodes cut after $N - 1$ decisions (a task's `time_limit`), the walk takes exponential time as well: one
    episode in $2^{N - 1}$ reaches the reward.

    **Raises:** `ValueError` for a length below 2 or an unknown variant.
    """
    check(isinstance(length, int) and length >= 2, "length", length, "an integer of at least 2")
    choice("variant", variant, CHAIN_VARIANTS)
    end = length - 1
    transitions = np.zeros((2, length, length))
    for state in range(end):
        transitions[0, state, max(state - 1, 0) if variant == "walk" else 0] = 1
        transitions[1, state, state + 1] = 1
    transitions[:, end, 0] = 1
    return FiniteMDP(transitions, np.eye(length)[end], np.eye(length))


def call_admission(
    capacity: int = 10,
    arrivals: Sequence[float] = (1.8, 1.6, 1.4),
    departures: Sequence[float] = (0.6, 0.5, 0.4),
    rewards: Sequence[float] = (1.0, 2.0, 4.0),
) -> FiniteMDP:
    r"""Call admission control (Marbach & Tsitsiklis, 1998), as in Baxter, Bartlett & Weaver (2001, section 4).

    A link carries at most `capacity` calls. Calls of type $m$ arrive at rate `arrivals[m]`, each leaves at rate
    `departures[m]`, and accepting one is rewarded with `rewards[m]`. The continuous-time process is uniformised at the
    rate $\sum_m \text{arrivals}_m + \text{capacity}\cdot\max_m \text{departures}_m$, with one step per event or
    non-event.

    A state consists of the calls in progress per type, and the type of the arriving call, or none. Action 1 accepts the
    arriving call if there is room. The observation is (one-hot type of the arriving call, calls in progress): `(types +
    1,)`. A reward belongs to the action in the state in which the call arrives; the average reward is per uniformised
    step.

    **Raises:** `ValueError` for a capacity below 1, or departures and rewards of other numbers of types.
    """
    types = len(arrivals)
    check(capacity >= 1, "capacity", capacity, "at least 1")
    same = len(departures) == types == len(rewards)
    check(same, "departures and rewards", (departures, rewards), f"of {types} types each")
    busy = [n for n in itertools.product(range(capacity + 1), repeat=types) if sum(n) <= capacity]
    rate = sum(arrivals) + capacity * max(departures)
    states = list(itertools.product(busy, range(types + 1)))  # the last value of the arriving type means none
    index = {state: i for i, state in enumerate(states)}
    transitions = np.zeros((2, len(states), len(states)))
    pay = np.zeros((2, len(states)))
    for (calls, ask), action in itertools.product(states, (0, 1)):
        accept = action == 1 and ask < types and sum(calls) < capacity
        after = tuple(n + (accept and m == ask) for m, n in enumerate(calls))
        pay[action, index[calls, ask]] = rewards[ask] if accept else 0
        row = transitions[action, index[calls, ask]]
        for m in range(types):
            row[index[after, m]] += arrivals[m] / rate
            if after[m]:
                fewer = tuple(n - (k == m) for k, n in enumerate(after))
                row[index[fewer, types]] += after[m] * departures[m] / rate
        row[index[after, types]] += 1 - row.sum()
    seen = np.array([[*(float(m == ask) for m in range(types)), float(sum(calls))] for calls, ask in states])
    return FiniteMDP(transitions, pay, seen, start=index[(0,) * types, types])


def parity(inputs: int = 2) -> FiniteMDP:
    """The parity of some bits, drawn anew for every decision: the simplest task that one layer of units cannot solve.

    The observation is the bits as -1 and 1. Action 1 is rewarded with 1 where an odd number of them is 1, and action 0
    where an even number is. Of two bits this is the exclusive or (Minsky & Papert, 1969).

    **Raises:** `ValueError` for fewer than 1 or more than 10 inputs.
    """
    check_integer("inputs", inputs, 1, 10)
    bits = np.array(list(itertools.product((-1.0, 1.0), repeat=inputs)))
    odd = (bits > 0).sum(1) % 2
    return FiniteMDP(np.full((2, len(bits), len(bits)), 1 / len(bits)), [1 - odd, odd], bits)


def load_unload(length: int = 5) -> FiniteMDP:
    r"""Carry loads from one end of a line to the other, without seeing whether one carries a load (Peshkin, Meuleau &
    Kaelbling, 1999).

    A line of `length` $= N$ places, with actions left (0) and right (1). Arriving at the left end, one is loaded;
    arriving at the right end with a load, it is unloaded and rewarded with 1. The observation is a one-hot vector: at
    the left end, at the right end, or between. The best policy with a memory earns $1/(2(N - 1))$. Without a memory,
    the best is to walk at random between the ends, which earns $1/(2(N - 1)^2)$.

    **Raises:** `ValueError` for a length below 3.
    """
    check_integer("length", length, 3)
    end = length - 1
    states = list(itertools.product(range(length), (0, 1)))  # place, load
    index = {state: i for i, state in enumerate(states)}
    transitions = np.zeros((2, len(states), len(states)))
    rewards = np.zeros((2, len(states)))
    for (place, load), action in itertools.product(states, (0, 1)):
        after = min(max(place + 2 * action - 1, 0), end)
        carried = 1 if after == 0 else 0 if after == end else load
        transitions[action, index[place, load], index[after, carried]] = 1
        rewards[action, index[place, load]] = after == end and load == 1
    seen = np.array([[place == 0, place == end, 0 < place < end] for place, _ in states], float)
    return FiniteMDP(transitions, rewards, seen, start=index[0, 1])


def t_maze(length: int = 5) -> FiniteMDP:
    r"""A T-maze: a cue at the start tells which way to turn at the end of a corridor (Bakker, 2002).

    From the start, `length` $= L$ steps lead to the junction. Actions are up (0), forward (1), down (2) and back (3).
    A turn at the junction ends the trial: it is rewarded with 4 if the cue said so, else with -0.1, as is walking into
    a wall. Then any action leads into the maze again, with either cue. The observation is a one-hot vector: cue up, cue
    down, corridor, junction, outside; the original codes the first four in three bits. A trial takes $L + 2$ decisions.
    So the best policy with a memory earns $4/(L + 2)$ per decision, and without one $1.95/(L + 2)$, by guessing.

    **Raises:** `ValueError` for a length below 1.
    """
    check_integer("length", length, 1)
    outside = 2 * (length + 1)
    transitions = np.zeros((4, outside + 1, outside + 1))
    rewards = np.zeros((4, outside + 1))
    transitions[:, outside, :2] = 0.5
    for place, cue, action in itertools.product(range(length + 1), (0, 1), range(4)):
        state = 2 * place + cue
        turn = place == length and action in (0, 2)
        after = place + (action == 1 and place < length) - (action == 3 and place > 0)
        transitions[action, state, outside if turn else 2 * after + cue] = 1
        right = turn and action == 2 * cue
        rewards[action, state] = 4.0 if right else -0.1 if turn or after == place else 0.0
    kinds = [0, 1, *[2] * (2 * (length - 1)), 3, 3, 4]
    return FiniteMDP(transitions, rewards, np.eye(5)[kinds], start=outside)


def episodes(mdp: FiniteMDP, steps: int) -> FiniteMDP:
    r"""The same world in episodes of `steps` decisions each, after which it starts anew. A state is one of `mdp` and
    the number of decisions in the episode, which the policy does not observe.

    Its average reward is the expected return of an episode, divided by `steps`; and so are its gradient and its Fisher
    matrix the expected return's and that of whole episodes, $\mathbb E\,uu'$ with $u = \sum_t \nabla\log\pi$.

    **Raises:** `ValueError` for fewer steps than 1.
    """
    check_integer("steps", steps, 1)
    actions, states = mdp.actions, mdp.states
    transitions = np.zeros((actions, steps, states, steps, states))
    for step in range(steps - 1):
        transitions[:, step, :, step + 1, :] = mdp.transitions
    transitions[:, -1, :, 0, mdp.start] = 1
    whole = steps * states
    rewards = np.tile(mdp.expected_rewards, (1, steps))
    observations = np.tile(mdp.observations, (steps, 1))
    return FiniteMDP(transitions.reshape(actions, whole, whole), rewards, observations, mdp.start)


class AdmissionThresholds(SigmoidUnits):
    r"""Accept a call of type $m$ with probability $\sigma(s(\theta_m - \text{calls in progress}))$.

    The policy of Baxter, Bartlett & Weaver (2001), with one threshold per type, so three parameters. Without an
    arriving call, the action has no effect and the score is zero.

    **Arguments:** `threshold` $\theta$, `(types,)`, in calls; `steepness` $s$, a fixed number, 1.5 in the source.
    """

    threshold: Float[Array, " types"] = eqx.field(converter=jnp.asarray)
    steepness: Float[Array, ""] = fixed(converter=jnp.asarray, default=1.5)

    def __check_init__(self) -> None:
        check(self.threshold.ndim == 1, "threshold", self.threshold.shape, "of shape (types,)")
        check(self.steepness.ndim == 0, "steepness", self.steepness.shape, "one number")

    @property
    def inputs(self) -> int:
        return self.threshold.shape[0] + 1

    @property
    def outputs(self) -> int:
        return 1

    def potential(self, observation: Float[Array, " inputs"]) -> Float[Array, " 1"]:
        return self.steepness * (jnp.sum(self.threshold * observation[:-1]) - observation[-1])[None]

    def potential_gradient(self, observation: Float[Array, " inputs"]) -> dict[str, Array]:
        # All thresholds belong to a single unit, so the gradient has no axis of units.
        return {"threshold": self.steepness * observation[:-1]}


def action_index(action: Array) -> Int[Array, ""]:
    """The index of an action: itself if it is an integer scalar, else the number spelt by a vector of bits."""
    if action.ndim == 0:
        return action.astype(jnp.int32)
    weights = 2 ** jnp.arange(action.shape[0] - 1, -1, -1)
    return jnp.sum(action.astype(jnp.int32) * weights, dtype=jnp.int32)


def _compact(transitions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Each row's possible successors first, padded by repeating the last one, and their cumulative probabilities."""
    possible = transitions > 0
    most = int(possible.sum(-1).max())
    order = np.argsort(~possible, axis=-1, kind="stable")[..., :most]
    probability = np.take_along_axis(transitions, order, axis=-1)
    count = possible.sum(-1, keepdims=True)
    last = np.take_along_axis(order, count - 1, axis=-1)
    successors = np.where(np.arange(most) < count, order, last).astype(np.int32)
    return successors, np.cumsum(probability, axis=-1)
