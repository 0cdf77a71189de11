"""A muscle that twitches at every spike, as a task; and what spike trains of units show."""

import dataclasses
from collections.abc import Mapping
from typing import Any, ClassVar, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from motorgrad.policies import Policy, SpikingUnits, abilities
from motorgrad.schema import count, number
from motorgrad.tasks import Task
from motorgrad.worlds import World

ACTIVE = 0.01  # spikes per decision from which a unit counts as recruited


class HeldDrive(World):
    """A drive from U[0, 1], which is drawn anew at every decision with the probability `change`. The state is the
    drive."""

    uniforms: ClassVar[int] = 2
    reset_uniforms: ClassVar[int] = 1

    def __init__(self, change: float) -> None:
        self.change = change

    def reset(self, uniforms: Float[Array, " 1"]) -> Float[Array, ""]:
        return uniforms[0]

    def step(self, state: Float[Array, ""], action: Array, uniforms: Float[Array, " 2"]) -> Float[Array, ""]:
        return jnp.where(uniforms[0] < self.change, uniforms[1], state)


class TwitchMemory(NamedTuple):
    """The drive that is observed before the next action, the force, and the force that was wanted of it."""

    drive: Float[Array, ""]
    force: Float[Array, ""]
    wanted: Float[Array, ""]


@dataclasses.dataclass(frozen=True)
class TwitchingMuscle(Task):
    """Grade the force of a muscle whose fibres twitch at every spike of their motoneuron (section 4.1.1 of the thesis).

    Observed: the drive $x$, one number from U[0, 1] that lasts for a while. Actions: each unit fires or not. The force
    follows the fraction of units that fire with the time constant of a twitch, so that it grows with the rate of spikes
    as well as with the number of units that fire. Reward: minus the squared difference from the wanted force, which is
    linear in the drive.
    """

    name: ClassVar[str] = "twitching-muscle"
    learner: ClassVar[Mapping[str, Any]] = {"policy": "spiking"}
    metric_names: ClassVar[tuple[str, ...]] = ("error",)
    metric_units: ClassVar[Mapping[str, str]] = {"error": "1"}

    units: int = count(8, 1, 10_000, help="number of units in the pool")
    hold: float = number(200.0, 1, 1e6, unit="decisions", help="mean time for which a drive lasts")
    twitch: float = number(10.0, 1, 1e6, unit="decisions", help="time constant of the force")
    slope: float = number(0.4, 0, 1, help="of the wanted force over the drive; 1 is the force of all units at once")
    intercept: float = number(0.05, 0, 1, help="the wanted force without a drive")

    @property
    def dynamics(self) -> HeldDrive:
        return HeldDrive(1 / self.hold)

    @property
    def observation_size(self) -> int:
        return 1

    @property
    def action_size(self) -> int:
        return self.units

    def wanted(self, drive: Any) -> Any:
        """The wanted force at a drive; arrays of any shape."""
        return self.slope * drive + self.intercept

    def init(self, uniforms: Float[Array, " 0"]) -> TwitchMemory:
        zero = jnp.zeros(())
        return TwitchMemory(zero, zero, zero)

    def observe(
        self, memory: TwitchMemory, state: Float[Array, ""], uniforms: Float[Array, " 0"]
    ) -> tuple[TwitchMemory, Float[Array, " 1"]]:
        return memory._replace(drive=state), state[None]

    def reward(
        self, memory: TwitchMemory, state: Float[Array, ""], action: Float[Array, " units"]
    ) -> tuple[TwitchMemory, Float[Array, ""], bool]:
        force = memory.force + (jnp.mean(action) - memory.force) / self.twitch
        wanted = self.wanted(memory.drive)
        return TwitchMemory(memory.drive, force, wanted), -jnp.square(force - wanted), False

    def metrics(self, memory: TwitchMemory, state: Float[Array, ""]) -> dict[str, Any]:
        """`error`: the absolute difference between the force and the wanted one."""
        return {"error": (jnp.abs(memory.force - memory.wanted), True)}


def spike_trains(policy: Policy, inputs: Float[Array, "decisions inputs"], key: jax.Array) -> tuple[Array, Array, Any]:
    """What a policy does on a sequence of inputs, from an empty memory.

    **Returns** the actions `(decisions, units)`, the probabilities of firing, and the scores.
    """

    def step(memory: Any, now: tuple[Array, Array]) -> tuple[Any, Any]:
        observation, uniforms = now
        seen = abilities.observation_with_memory(policy, memory, observation)
        action = policy.sample(seen, uniforms)
        return abilities.remember(policy, seen, action), (action, policy.prob(seen), policy.score(seen, action))

    uniforms = jax.random.uniform(key, (len(inputs), policy.uniforms))
    return jax.lax.scan(step, abilities.initial_memory(policy), (inputs, uniforms))[1]


def responses(policies: Policy, drives: np.ndarray, decisions: int) -> tuple[np.ndarray, np.ndarray]:
    """How pools fire at constant drives.

    **Arguments:** `policies` along a leading axis of seeds; `drives` (drives,); the `decisions` for which each lasts.

    **Returns** the spikes of every unit per decision, `(seeds, drives, units)`, and the coefficient of variation of the
    intervals between its spikes, NaN where there are fewer than ten.
    """

    def of(policy: Policy, drive: Array, key: jax.Array) -> Array:
        return spike_trains(policy, jnp.broadcast_to(drive, (decisions, 1)), key)[0] > 0

    def of_all(policy: Policy) -> Array:
        keys = jax.random.split(jax.random.key(0), len(drives))
        return jax.vmap(lambda drive, key: of(policy, drive, key))(jnp.asarray(drives, jnp.float32), keys)

    fired = np.asarray(jax.jit(jax.vmap(of_all))(policies)).swapaxes(2, 3)
    variation = np.full(fired.shape[:3], np.nan)
    for place in np.ndindex(*variation.shape):
        intervals = np.diff(np.flatnonzero(fired[place]))
        if len(intervals) >= 10:
            variation[place] = intervals.std() / intervals.mean()
    return fired.mean(-1), variation


def pairings(unit: SpikingUnits, rate: float, decisions: int, key: jax.Array, reach: int) -> np.ndarray:
    """The mean score of a weight by the time from a spike of its input to one of the unit.

    The inputs fire at random, independently, with the probability `rate` at a decision. The score is that of the later
    of the two spikes: the unit's, or, where the input comes after it, that at the decision of the input.

    **Returns** (2 × `reach` + 1): the mean over all pairs at −`reach` … `reach` decisions.
    """
    chance, own = jax.random.split(key)
    inputs = (jax.random.uniform(chance, (decisions, unit.observation_size)) < rate).astype(jnp.float32)
    actions, _, scores = jax.jit(spike_trains)(unit, inputs, own)
    before = np.asarray(inputs)
    after = np.asarray(actions[:, 0])
    step = np.asarray(scores.weights[:, 0])
    found = np.empty(2 * reach + 1)
    for lag in range(-reach, reach + 1):
        first = slice(0, decisions - abs(lag))
        last = slice(abs(lag), decisions)
        pairs = before[first] * after[last, None] if lag >= 0 else before[last] * after[first, None]
        found[lag + reach] = (pairs * step[last]).sum() / pairs.sum()
    return found
