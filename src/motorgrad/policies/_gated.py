"""Policies of policies: parts that act only while a unit above them fires."""

import itertools
from typing import Any, Self

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from motorgrad._errors import check
from motorgrad.policies._binary import BinaryUnits, product
from motorgrad.policies._policy import trainable


class Gated(BinaryUnits):
    r"""Pools that act only while their gate, a unit above them, fires; gates and pools are learnt together.

    Gate $i$ opens the pool `branches[i]`. While it is silent all units of that pool are, surely:
    $\log\pi = \sum_i \left(\log\pi_i(A_i) + A_i\,\log\pi_{b_i}(a_{b_i})\right)$. So a pool has a score only where its
    gate fired, and gates divide the inputs in regions within each of which a pool learns what to do (section 6.5.4 of
    the thesis). A branch may be gated itself, and so on.

    The action is that of the gates, then those of the branches in their order; `prob` are the units' marginal
    probabilities. `enumerate` lists the possible actions only. The Fisher matrix has no entries between the parts: a
    gate's score has zero mean given the input, a branch's given that its gate fired.

    **Arguments:** `gate`, a pool of independent units; `branches`, a pool for each of them over the same observations.
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
        sizes = [branch.inputs for branch in self.branches]
        wanted = f"over observations of the gate's length, {self.gate.inputs}"
        check(set(sizes) == {self.gate.inputs}, "branches", sizes, wanted)

    @property
    def inputs(self) -> int:
        return self.gate.inputs

    @property
    def outputs(self) -> int:
        return self.gate.outputs + sum(branch.outputs for branch in self.branches)

    @property
    def uniforms(self) -> int:
        return self.gate.uniforms + sum(branch.uniforms for branch in self.branches)

    @property
    def independent(self) -> bool:
        return False

    @property
    def separate(self) -> bool:
        return all(part.separate for part in (self.gate, *self.branches))

    def _parts(self, values: Float[Array, " units"]) -> tuple[Float[Array, " _"], list[Float[Array, " _"]]]:
        """The gate's share of an action, and the branches'."""
        ends = itertools.accumulate((each.outputs for each in (self.gate, *self.branches)), initial=0)
        gate, *rest = [values[start:end] for start, end in itertools.pairwise(ends)]
        return gate, rest

    def prob(self, observation: Float[Array, " inputs"]) -> Float[Array, " units"]:
        opens = self.gate.prob(observation)
        below = [opens[i] * branch.prob(observation) for i, branch in enumerate(self.branches)]
        return jnp.concatenate([opens, *below])

    def sample(self, observation: Float[Array, " inputs"], uniforms: Float[Array, " units"]) -> Float[Array, " units"]:
        first, rest = self._parts(uniforms)
        opened = self.gate.sample(observation, first)
        below = [each.sample(observation, rest[i]) for i, each in enumerate(self.branches)]
        return jnp.concatenate([opened, *(opened[i] * part for i, part in enumerate(below))])

    def mode(self, observation: Float[Array, " inputs"]) -> Float[Array, " units"]:
        """The most probable joint action: a gate fires where that and its pool's mode are likelier than its silence."""
        best = [branch.mode(observation) for branch in self.branches]
        likely = [branch.log_prob(observation, a) for branch, a in zip(self.branches, best, strict=True)]
        ones = jnp.ones_like(self.gate.prob(observation))
        fires, silent = (self.gate.log_probs(observation, a) for a in (ones, 0 * ones))
        opened = (fires + jnp.stack(likely) > silent).astype(ones.dtype)
        return jnp.concatenate([opened, *(opened[i] * part for i, part in enumerate(best))])

    def log_probs(self, observation: Float[Array, " inputs"], action: Float[Array, " units"]) -> Float[Array, " units"]:
        """Each unit's term, given the gates above it."""
        opened, below = self._parts(action)
        terms = [self.gate.log_probs(observation, opened)]
        for i, (branch, part) in enumerate(zip(self.branches, below, strict=True)):
            closed = jnp.where(part > 0, -jnp.inf, 0)
            terms.append(jnp.where(opened[i] > 0, branch.log_probs(observation, part), closed))
        return jnp.concatenate(terms)

    def score(self, observation: Float[Array, " inputs"], action: Float[Array, " units"]) -> Self:
        opened, below = self._parts(action)
        scores = [
            jax.tree.map(lambda s, i=i: jnp.where(opened[i] > 0, s, 0), branch.score(observation, part))
            for i, (branch, part) in enumerate(zip(self.branches, below, strict=True))
        ]
        return self._gradient(self.gate.score(observation, opened), scores)

    def _gradient(self, gate: Any, branches: list[Any]) -> Self:
        return eqx.tree_at(lambda each: (each.gate, each.branches), trainable(self), (gate, tuple(branches)))

    def blocks(self, gradient: Any) -> tuple[Float[Array, "units parameters"], ...]:
        """The gate's blocks, then the branches' in their order."""
        parts = zip((self.gate, *self.branches), (gradient.gate, *gradient.branches), strict=True)
        return tuple(block for policy, part in parts for block in policy.blocks(part))

    def from_blocks(self, blocks: tuple[Float[Array, "units parameters"], ...]) -> Self:
        rest, gradients = iter(blocks), []
        for policy in (self.gate, *self.branches):
            count = len(policy.blocks(trainable(policy)))
            gradients.append(policy.from_blocks(tuple(itertools.islice(rest, count))))
        return self._gradient(gradients[0], gradients[1:])

    def fisher(
        self, observation: Float[Array, " inputs"], action: Float[Array, " units"]
    ) -> tuple[Float[Array, "units parameters parameters"], ...]:
        """The gate's matrices and the branches' times their gate's probability; of a branch whose units share
        parameters, the sample of what was drawn."""
        opened, below = self._parts(action)
        opens, matrices = self.gate.prob(observation), [*self.gate.fisher(observation, opened)]
        for i, (branch, part) in enumerate(zip(self.branches, below, strict=True)):
            share = opens[i] if branch.separate else (opened[i] > 0).astype(opens.dtype)
            matrices += [share * matrix for matrix in branch.fisher(observation, part)]
        return tuple(matrices)

    def allowed(self, step: Any) -> Any:
        parts = zip((self.gate, *self.branches), (step.gate, *step.branches), strict=True)
        gate, *branches = [policy.allowed(part) for policy, part in parts]
        return eqx.tree_at(lambda each: (each.gate, each.branches), step, (gate, tuple(branches)))

    def limited(self) -> Self:
        within = (self.gate.limited(), tuple(branch.limited() for branch in self.branches))
        return eqx.tree_at(lambda each: (each.gate, each.branches), self, within)

    def entropy(self, observation: Float[Array, " inputs"]) -> Float[Array, ""]:
        opens = self.gate.prob(observation)
        below = [opens[i] * branch.entropy(observation) for i, branch in enumerate(self.branches)]
        return sum(below, start=self.gate.entropy(observation))

    def enumerate(self) -> Float[Array, "actions units"]:
        """Every action that is possible: units below a silent gate are silent."""
        with jax.ensure_compile_time_eval():  # how many there are depends on the gates' bits
            lists, silent = [], [jnp.zeros((1, branch.outputs)) for branch in self.branches]
            for opened in self.gate.enumerate():
                parts = zip(self.branches, np.asarray(opened) > 0, silent, strict=True)
                below = [branch.enumerate() if open_ else off for branch, open_, off in parts]
                lists.append(product([opened[None], *below]))
            return jnp.concatenate(lists)
