"""Pools side by side, and pools behind gates."""

import itertools
from collections.abc import Sequence
from typing import Self

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from motorgrad._errors import check
from motorgrad.policies import abilities
from motorgrad.policies._arguments import SizedTask, sizes
from motorgrad.policies._binary import BinaryUnits, Hyperplanes, product, zero_hyperplanes
from motorgrad.policies._features import lattice
from motorgrad.policies._local import LocalGaussians, input_ranges, tiles
from motorgrad.policies._parameters import in_structure
from motorgrad.policies._policy import Composed, Policy, check_plain
from motorgrad.policies._starting import POSITIVE, SHARE_ABOVE_0, Initial, InitialPolicy, function_of
from motorgrad.policies.abilities import Regions
from motorgrad.schema import count, static


class Pools(Composed):
    """Pools side by side on one observation, which draw their actions independently of each other.

    The action is the concatenation of the pools' actions, and the score that of their scores.
    """

    pools: eqx.AbstractVar[tuple[Policy, ...]]

    def __check_init__(self) -> None:
        check(len(self.pools) > 0, "pools", self.pools, "at least one pool of units")
        lengths = {pool.inputs for pool in self.pools}
        check(len(lengths) == 1, "pools", sorted(lengths), "over observations of one length")
        check_plain("pools", *self.pools)

    @property
    def inputs(self) -> int:
        return self.pools[0].inputs

    @property
    def outputs(self) -> int:
        return sum(pool.outputs for pool in self.pools)

    @property
    def uniforms(self) -> int:
        return sum(pool.uniforms for pool in self.pools)

    def prob(self, observation: Float[Array, " inputs"]) -> Float[Array, " units"]:
        return jnp.concatenate([pool.prob(observation) for pool in self.pools])

    def sample(self, observation: Float[Array, " inputs"], uniforms: Float[Array, " units"]) -> Float[Array, " units"]:
        parts = zip(self.pools, _shares(self.pools, uniforms, of="uniforms"), strict=True)
        return jnp.concatenate([pool.sample(observation, part) for pool, part in parts])

    def mode(self, observation: Float[Array, " inputs"]) -> Float[Array, " units"]:
        return jnp.concatenate([pool.mode(observation) for pool in self.pools])

    def log_prob(self, observation: Float[Array, " inputs"], action: Float[Array, " units"]) -> Float[Array, ""]:
        parts = zip(self.pools, _shares(self.pools, action), strict=True)
        return sum((pool.log_prob(observation, part) for pool, part in parts), start=jnp.zeros(()))

    def score(self, observation: Float[Array, " inputs"], action: Float[Array, " units"]) -> Self:
        parts = zip(self.pools, _shares(self.pools, action), strict=True)
        return in_structure(self, pools=tuple(pool.score(observation, part) for pool, part in parts))

    def score_sum(
        self, observations: Float[Array, "decisions inputs"], actions: Array, weights: Float[Array, "decisions sums"]
    ) -> Self:
        parts = zip(self.pools, _shares(self.pools, actions.T), strict=True)
        sums = tuple(abilities.score_sum(pool, observations, part.T, weights) for pool, part in parts)
        return in_structure(self, pools=sums)

    def entropy_sum(self, observations: Float[Array, "decisions inputs"]) -> Float[Array, ""]:
        return sum((abilities.entropy_sum(pool, observations) for pool in self.pools), start=jnp.zeros(()))

    def fisher(
        self, observation: Float[Array, " inputs"], action: Float[Array, " units"]
    ) -> tuple[Float[Array, "units parameters parameters"], ...]:
        """The pools' Fisher matrices. Cross terms of independent units are zero."""
        parts = zip(self.pools, _shares(self.pools, action), strict=True)
        return tuple(matrix for pool, part in parts for matrix in abilities.fisher(pool, observation, part))

    def fisher_coordinates(
        self, observation: Float[Array, " inputs"], action: Float[Array, " units"]
    ) -> Float[Array, " coordinates"]:
        parts = zip(self.pools, _shares(self.pools, action), strict=True)
        return jnp.concatenate([abilities.fisher_coordinates(pool, observation, part) for pool, part in parts])

    def fisher_sum(
        self, observations: Float[Array, "decisions inputs"], actions: Array, weights: Float[Array, " decisions"]
    ) -> tuple[Float[Array, "units parameters parameters"], ...]:
        parts = zip(self.pools, _shares(self.pools, actions.T), strict=True)
        return tuple(
            matrix for pool, part in parts for matrix in abilities.fisher_sum(pool, observations, part.T, weights)
        )

    def entropy(self, observation: Float[Array, " inputs"]) -> Float[Array, ""]:
        return sum((pool.entropy(observation) for pool in self.pools), start=jnp.zeros(()))


class Factored(Pools, BinaryUnits):
    r"""Independent pools side by side on one observation: $\log\pi = \sum_k \log\pi_k$.

    The action is the concatenation of the pools' actions, and the score that of their scores (section 4.2.1 of the
    thesis). Pools of different kinds may be mixed (section 6.5.2). A `Factored` policy is a pool itself, so it nests.

    **Arguments:** `pools`, a sequence of at least one pool of binary units over observations of the same length.

    **Example:**

    ```python
    reflex = Hyperplanes(weights=[[2.5, 0.0]], bias=[0.0])
    corrections = LocalGaussians(centre=[[0.3, 0.4], [-0.5, 0.0]], log_width=jnp.full((2, 2), -0.5))
    Factored([reflex, corrections]).outputs  # 3
    ```
    """

    pools: tuple[BinaryUnits, ...] = eqx.field(converter=tuple)

    def __check_init__(self) -> None:
        kinds = [type(pool).__name__ for pool in self.pools]
        check(all(isinstance(pool, BinaryUnits) for pool in self.pools), "pools", kinds, "pools of binary units")
        super().__check_init__()

    @property
    def independent(self) -> bool:
        return all(pool.independent for pool in self.pools)

    @property
    def separate(self) -> bool:
        return all(pool.separate for pool in self.pools)

    def log_probs(self, observation: Float[Array, " inputs"], action: Float[Array, " units"]) -> Float[Array, " units"]:
        parts = zip(self.pools, _shares(self.pools, action), strict=True)
        return jnp.concatenate([pool.log_probs(observation, part) for pool, part in parts])

    def regions(self) -> Regions | None:
        return _joined_regions(self.pools)

    def enumerate(self) -> Float[Array, "actions units"]:
        """All joint actions; those of the last pool change fastest."""
        return product([abilities.enumerate(pool) for pool in self.pools])


class Gated(Composed, BinaryUnits):
    r"""Pools that act only while their gate, a unit above them, fires. Gates and pools learn together.

    Gate $i$ opens the pool `branches[i]`. While a gate is silent, all units behind it are silent:
    $\log\pi = \sum_i \left(\log\pi_i(A_i) + A_i\,\log\pi_{b_i}(a_{b_i})\right)$. So a pool has a score only if its gate
    fired. Gates thus divide the input space into regions, and each pool learns what to do within its own (section 6.5.4
    of the thesis). A branch may be gated itself, and so on.

    The action is that of the gates, then those of the branches in order. `prob` gives the marginal probabilities of all
    units, and `enumerate` lists possible actions only. The Fisher matrix has no cross terms between the parts: the
    score of a gate has zero mean given the input, that of a branch given that its gate fired.

    **Arguments:** `gate`, a pool of independent units; `branches`, one pool per gate over the same observations.

    **Example:**

    ```python
    policy = Gated(
        gate=LocalGaussians(centre=[[0.0, 0.0]], log_width=[[-0.5, -0.5]], p_max=0.8),
        branches=[Hyperplanes(weights=[[2.0, 0.0], [-2.0, 0.0]], bias=[0.0, 0.0])],
    )
    policy.outputs, len(policy.enumerate())  # (3, 5): all silent, or the gate and any pattern behind it
    ```
    """

    gate: BinaryUnits
    branches: tuple[BinaryUnits, ...] = eqx.field(converter=tuple)

    def __check_init__(self) -> None:
        check(isinstance(self.gate, BinaryUnits), "gate", type(self.gate).__name__, "a pool of binary units")
        kinds = [type(branch).__name__ for branch in self.branches]
        check(all(isinstance(each, BinaryUnits) for each in self.branches), "branches", kinds, "pools of binary units")
        check(self.gate.independent, "gate", type(self.gate).__name__, "a pool of independent units")
        count = self.gate.outputs
        check(len(kinds) == count, "branches", kinds, f"as many as the gate has units, {count}")
        lengths = [branch.inputs for branch in self.branches]
        wanted = f"over observations of the gate's length, {self.gate.inputs}"
        check(set(lengths) == {self.gate.inputs}, "branches", lengths, wanted)

    @property
    def _pools(self) -> tuple[BinaryUnits, ...]:
        return (self.gate, *self.branches)

    @property
    def inputs(self) -> int:
        return self.gate.inputs

    @property
    def outputs(self) -> int:
        return sum(pool.outputs for pool in self._pools)

    @property
    def uniforms(self) -> int:
        return sum(pool.uniforms for pool in self._pools)

    @property
    def independent(self) -> bool:
        return False

    @property
    def separate(self) -> bool:
        return all(pool.separate for pool in self._pools)

    def prob(self, observation: Float[Array, " inputs"]) -> Float[Array, " units"]:
        opens = self.gate.prob(observation)
        below = [opens[i] * branch.prob(observation) for i, branch in enumerate(self.branches)]
        return jnp.concatenate([opens, *below])

    def sample(self, observation: Float[Array, " inputs"], uniforms: Float[Array, " units"]) -> Float[Array, " units"]:
        first, *rest = _shares(self._pools, uniforms, of="uniforms")
        opened = self.gate.sample(observation, first)
        below = [branch.sample(observation, rest[i]) for i, branch in enumerate(self.branches)]
        return jnp.concatenate([opened, *(opened[i] * part for i, part in enumerate(below))])

    def mode(self, observation: Float[Array, " inputs"]) -> Float[Array, " units"]:
        """The most probable joint action: a gate fires if this, with its pool's mode, is more probable than silence."""
        best = [branch.mode(observation) for branch in self.branches]
        log_best = [branch.log_prob(observation, a) for branch, a in zip(self.branches, best, strict=True)]
        ones = jnp.ones_like(self.gate.prob(observation))
        fires, silent = (self.gate.log_probs(observation, a) for a in (ones, 0 * ones))
        opened = (fires + jnp.stack(log_best) > silent).astype(ones.dtype)
        return jnp.concatenate([opened, *(opened[i] * part for i, part in enumerate(best))])

    def log_probs(self, observation: Float[Array, " inputs"], action: Float[Array, " units"]) -> Float[Array, " units"]:
        """The term of each unit, given the gates above it."""
        opened, *below = _shares(self._pools, action)
        terms = [self.gate.log_probs(observation, opened)]
        for i, (branch, part) in enumerate(zip(self.branches, below, strict=True)):
            closed = jnp.where(part > 0, -jnp.inf, 0)
            terms.append(jnp.where(opened[i] > 0, branch.log_probs(observation, part), closed))
        return jnp.concatenate(terms)

    def score(self, observation: Float[Array, " inputs"], action: Float[Array, " units"]) -> Self:
        opened, *below = _shares(self._pools, action)
        branches = tuple(
            jax.tree.map(lambda s, i=i: jnp.where(opened[i] > 0, s, 0), branch.score(observation, part))
            for i, (branch, part) in enumerate(zip(self.branches, below, strict=True))
        )
        return in_structure(self, gate=self.gate.score(observation, opened), branches=branches)

    def fisher(
        self, observation: Float[Array, " inputs"], action: Float[Array, " units"]
    ) -> tuple[Float[Array, "units parameters parameters"], ...]:
        """The gate's matrices, and each branch's times the probability of its gate.

        For a branch whose units share parameters, this is the sample for the drawn action.
        """
        opened, *below = _shares(self._pools, action)
        opens = self.gate.prob(observation)
        matrices = [*abilities.fisher(self.gate, observation, opened)]
        for i, (branch, part) in enumerate(zip(self.branches, below, strict=True)):
            share = opens[i] if branch.separate else (opened[i] > 0).astype(opens.dtype)
            matrices += [share * matrix for matrix in abilities.fisher(branch, observation, part)]
        return tuple(matrices)

    def regions(self) -> Regions | None:
        return _joined_regions(self._pools)

    def entropy(self, observation: Float[Array, " inputs"]) -> Float[Array, ""]:
        opens = self.gate.prob(observation)
        below = [opens[i] * branch.entropy(observation) for i, branch in enumerate(self.branches)]
        return sum(below, start=self.gate.entropy(observation))

    def enumerate(self) -> Float[Array, "actions units"]:
        """All possible actions: units below a silent gate are silent."""
        with jax.ensure_compile_time_eval():  # the number of actions depends on the values of the gates' bits
            gates = np.asarray(abilities.enumerate(self.gate))
            active = [np.asarray(abilities.enumerate(branch)) for branch in self.branches]
            silent = [np.zeros((1, branch.outputs), gates.dtype) for branch in self.branches]
            lists = []
            for opened in gates:
                below = [on if is_open else off for is_open, on, off in zip(opened > 0, active, silent, strict=True)]
                lists.append(product([opened[None], *below]))
            return jnp.concatenate(lists)


def _shares(pools: Sequence[Policy], values: Float[Array, " units"], of: str = "outputs") -> list[Float[Array, " _"]]:
    """Each pool's share of an action, or of uniform numbers."""
    ends = itertools.accumulate((getattr(pool, of) for pool in pools), initial=0)
    return [values[start:end] for start, end in itertools.pairwise(ends)]


def _joined_regions(pools: Sequence[BinaryUnits]) -> Regions | None:
    regions = [each for pool in pools if (each := abilities.regions(pool)) is not None]
    if len(regions) < len(pools):
        return None
    return Regions(*(np.concatenate(arrays) for arrays in zip(*regions, strict=True)))


class InitialMixture(InitialPolicy):
    """Local units laid out by `tiles`, plus global units (section 6.5.2 of the thesis).

    The last `hyperplanes` units of the action are global, with zero weights and one common `bias`.
    """

    hyperplanes: int = count(2, 1, help="how many of them are global")
    copies: int = count(1, 1, help="consecutive local units that share a centre")
    width: float = static(0.16, allowed=POSITIVE, help="a standard deviation, as a fraction of the range")
    p_max: float = static(1.0, allowed=SHARE_ABOVE_0, help="the probability of firing at a unit's centre")
    bias: float = static(0.0, help="the common bias of the global units")

    def start(self, task: SizedTask | int) -> Initial:
        inputs, outputs = sizes(task, self.units)
        wanted = f"from 1 to {outputs - 1}, fewer than the {outputs} units"
        check(self.hyperplanes < outputs, "hyperplanes", self.hyperplanes, wanted)
        everywhere = Hyperplanes(jnp.zeros((self.hyperplanes, inputs)), jnp.full(self.hyperplanes, self.bias))
        return Factored([tiles(task, outputs - self.hyperplanes, self.copies, self.width, self.p_max), everywhere])


mixture = function_of(InitialMixture)


class InitialGated(InitialPolicy):
    """Local Gaussian gates over the range of the inputs, with hyperplanes behind each (section 6.5.4 of the thesis).

    The hyperplanes start with zero weights. The gates are laid out like the places of `tiles`. With more than one of
    `levels` there are further gates behind each gate, laid out over the region from one width below its centre to one
    width above; the hyperplanes are behind the last level, shared evenly among the gates. The action is ordered as in
    `Gated`.
    """

    units: int | None = count(
        None, 1, help="the number of units, the gates included, by default one for each action of the task"
    )
    gates: int = count(1, 1, help="the number of gates on each level")
    levels: int = count(1, 1, help="the number of levels of gates, one behind the other")
    width: float = static(0.3, allowed=POSITIVE, help="a standard deviation, as a fraction of the range")
    p_max: float = static(1.0, allowed=SHARE_ABOVE_0, help="the probability of firing at a unit's centre")

    def start(self, task: SizedTask | int) -> Initial:
        inputs, outputs = sizes(task, self.units)
        ranges = input_ranges(task, inputs)
        places = lattice(self.gates, inputs)

        def pool(low: np.ndarray, extent: np.ndarray, count: int, level: int) -> Gated:
            wanted = f"more than the {self.gates} gates of each pool: at least one unit behind every gate"
            check(count >= 2 * self.gates, "outputs", outputs, wanted)
            centre = low + extent * places
            widths = self.width * extent
            shares = [len(part) for part in np.array_split(np.arange(count - self.gates), self.gates)]
            gate = LocalGaussians(centre, np.log(np.broadcast_to(widths, centre.shape)), p_max=jnp.asarray(self.p_max))
            below = zip(centre, shares, strict=True)
            if level == 1:
                return Gated(gate, [zero_hyperplanes(inputs, share) for _, share in below])
            return Gated(gate, [pool(middle - widths, 2 * widths, share, level - 1) for middle, share in below])

        return pool(ranges[:, 0], ranges[:, 1] - ranges[:, 0], outputs, self.levels)


gated = function_of(InitialGated)
