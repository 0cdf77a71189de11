"""Call admission control: which calls to accept on a link of limited capacity."""

import itertools
from collections.abc import Sequence

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from motorgrad._errors import check
from motorgrad.policies import SigmoidUnits, fixed
from motorgrad.worlds._finite import FiniteMDP


def call_admission(
    capacity: int = 10,
    arrivals: Sequence[float] = (1.8, 1.6, 1.4),
    departures: Sequence[float] = (0.6, 0.5, 0.4),
    rewards: Sequence[float] = (1.0, 2.0, 4.0),
) -> FiniteMDP:
    r"""The admission problem of Marbach & Tsitsiklis (1998), as in Baxter, Bartlett & Weaver (2001, section 4).

    A link carries at most `capacity` calls. Calls of type $m$ arrive at rate `arrivals[m]`, each leaves at rate
    `departures[m]`, and accepting one pays `rewards[m]`. The continuous-time process is uniformised at the rate
    $\sum_m \text{arrivals}_m + \text{capacity}\cdot\max_m \text{departures}_m$, one step per event or non-event.

    A state is (calls of each type in progress, which type asks to be let in, or none). Action 1 accepts the call that
    asks, if there is room. The observation is (one-hot type of the asking call, calls in progress): `(types + 1,)`.
    Rewards belong to the action in the state where the call asks; the average reward is that of one uniformised step.

    **Raises:** `ValueError` for a capacity below 1 or departures and rewards of other numbers of types.
    """
    types = len(arrivals)
    check(capacity >= 1, "capacity", capacity, "at least 1")
    same = len(departures) == types == len(rewards)
    check(same, "departures and rewards", (departures, rewards), f"of {types} types each")
    busy = [n for n in itertools.product(range(capacity + 1), repeat=types) if sum(n) <= capacity]
    rate = sum(arrivals) + capacity * max(departures)
    states = list(itertools.product(busy, range(types + 1)))  # the last value of the asking type means none
    index = {state: i for i, state in enumerate(states)}
    transitions, pay = np.zeros((2, len(states), len(states))), np.zeros((2, len(states)))
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


class AdmissionThresholds(SigmoidUnits):
    r"""Accept a call of type $m$ with probability $\sigma(s(\theta_m - \text{calls in progress}))$.

    The policy of Baxter, Bartlett & Weaver (2001): one threshold a type, so three parameters; where no call asks, the
    action is without effect and the score is zero.

    **Arguments:** `threshold` $\theta$, `(types,)`, in calls; `steepness` $s$, one number, fixed, 1.5 in the source.
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
        # There is one unit, which all thresholds belong to: the gradient has no axis of units, as they have none.
        return {"threshold": self.steepness * observation[:-1]}
