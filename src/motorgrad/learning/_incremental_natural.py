r"""Natural gradients without systems to solve (Bhatnagar, Sutton, Ghavamzadeh & Lee, 2009).

Both algorithms take a gradient sample $g$: $\delta\psi$ with the score $\psi$ in the paper, the sample of any estimator
here. At every decision they compute a few products, where `FisherMetric` solves a system.
"""

from typing import ClassVar, Literal, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, PyTree

from motorgrad._branching import Flag, where
from motorgrad.learning._chain import Updates, inner
from motorgrad.learning._learner import Transition
from motorgrad.learning._natural import MAX_BLOCK_PARAMETERS, Blocks, Metric, first_blocks, identities
from motorgrad.learning._schedules import Steps
from motorgrad.policies import Policy, abilities, trainable
from motorgrad.schema import number


class CompatibleWeights(Metric):
    r"""The weights $w$ of the compatible features, which are the natural gradient (Bhatnagar et al., 2009).

    The advantage of an action is approximated by $w \cdot \psi$, linear in its own score. The weights of least square
    error are $w = F^{-1}\nabla\eta$ (Sutton et al., 2000; Kakade, 2001). They are learned at every decision,

    $$w \leftarrow w + \alpha\,(g - \psi\psi'w),$$

    and are the direction of the step in place of $g$. A decision costs one more score, and no matrix is kept, yet the
    correlations of all parameters count. $w$ is a mean over some $1/\alpha|\psi|^2$ decisions, like a momentum: the
    policy must change more slowly.

    **Raises:** `ValueError` in an `Agent` that makes steps of several samples.
    """

    steps_from: ClassVar[Literal["any", "sample", "batch"]] = "sample"

    rate: float = number(0.02, 0, help=r"$\alpha$. Stable where $\alpha|\psi|^2$ is well below 1")

    def init(self, policy: Policy) -> PyTree[Array]:
        return jax.tree.map(jnp.zeros_like, trainable(policy))

    def observe(self, state: PyTree[Array], policy: Policy, transition: Transition) -> PyTree[Array]:
        score = policy.score(transition.observation, transition.action)
        along = self.rate * inner(score, state)
        moved = jax.tree.map(lambda w, s: (w - along * s).astype(w.dtype), state, score)
        return where(transition.diverged, state, moved)

    def update(
        self, updates: Updates, state: PyTree[Array], policy: Policy, steps: Steps, due: Flag
    ) -> tuple[Updates, PyTree[Array]]:
        # Updates descend: they are minus the gradient.
        weights = jax.tree.map(lambda w, u: (w - self.rate * u).astype(w.dtype), state, updates)
        return jax.tree.map(jnp.negative, weights), weights

    def reset(self, state: PyTree[Array], policy: Policy) -> PyTree[Array]:
        return jax.tree.map(jnp.zeros_like, state)


class InverseState(NamedTuple):
    """The inverse of each block, and the coordinate whose damping is due, counted from 0."""

    blocks: Blocks
    turn: Int[Array, ""]


class ShermanMorrison(Metric):
    r"""The inverse Fisher matrix of each unit, kept by rank-one updates (Bhatnagar et al., 2009).

    After every decision $F \leftarrow (1 - \alpha)\,F + \alpha\,\psi\psi'$ with the score of the action that was drawn,
    and by the formula of Sherman and Morrison (1950)

    $$F^{-1} \leftarrow \frac{1}{1 - \alpha}\Big[F^{-1} -
    \frac{\alpha\,F^{-1}\psi\,(F^{-1}\psi)'}{1 - \alpha + \alpha\,\psi'F^{-1}\psi}\Big].$$

    Along directions that scores do not have, as of softmax, the original inverse grows without bounds. So each decision
    takes in the damping of one of the $n$ coordinates too, in turn, by a second update of rank one, $F \leftarrow F +
    \alpha n d\,e_ie_i'$; after all turns it is that of $F + dI$, but for a ripple of the order of $\alpha n$.

    **Raises:** `ValueError` for a value out of range; from `init`, for a policy with more than 4,096 parameters in a
    block.
    """

    rate: float = number(
        1e-3,
        0,
        1,
        open_low=True,
        open_high=True,
        help=r"$\alpha$; the matrix is a mean over about $1/\alpha$ decisions",
    )
    damping: float = number(0.01, 0, open_low=True, help="$d$, in the units of $F$")
    initial: float = number(1.0, 0, open_low=True, at_start=True, help="first diagonal of $F$, in the same units")

    def init(self, policy: Policy) -> InverseState:
        rows = abilities.blocks(policy, jax.tree.map(jnp.zeros_like, trainable(policy)))
        blocks = first_blocks(policy, rows, 1 / self.initial, "CompatibleWeights")
        return InverseState(blocks, jnp.zeros((), jnp.int32))

    def observe(self, state: InverseState, policy: Policy, transition: Transition) -> InverseState:
        rows = abilities.blocks(policy, policy.score(transition.observation, transition.action))

        def after(inverse: Array, score: Array) -> Array:
            size = score.shape[1]
            inverse = _rank_one(inverse / (1 - self.rate), jnp.sqrt(self.rate) * score)
            weight = jnp.sqrt(self.rate * self.damping * size)
            one = weight * (jnp.arange(size) == state.turn % size).astype(score.dtype)
            return _rank_one(inverse, jnp.broadcast_to(one, score.shape))

        blocks = tuple(after(*pair) for pair in zip(state.blocks, rows, strict=True))
        turn = (state.turn + 1) % MAX_BLOCK_PARAMETERS
        return where(transition.diverged, state, InverseState(blocks, turn))

    def update(
        self, updates: Updates, state: InverseState, policy: Policy, steps: Steps, due: Flag
    ) -> tuple[Updates, InverseState]:
        pairs = zip(state.blocks, abilities.blocks(policy, updates), strict=True)
        return abilities.from_blocks(
            policy, tuple((inverse * row[:, None, :]).sum(-1) for inverse, row in pairs)
        ), state

    def after_growth(self, state: InverseState, new: Bool[Array, " units"]) -> InverseState:
        fresh = (identities(block[:, 0], 1 / self.initial) for block in state.blocks)
        pairs = zip(state.blocks, fresh, strict=True)
        return state._replace(blocks=tuple(jnp.where(new[:, None, None], start, block) for block, start in pairs))


def _rank_one(
    inverse: Float[Array, "units parameters parameters"], vector: Float[Array, "units parameters"]
) -> Float[Array, "units parameters parameters"]:
    """The inverse after the matrix had the vector times its transpose added."""
    along = (inverse * vector[:, None, :]).sum(-1)
    # Rounded alike on both sides of the diagonal: nothing would make the matrix symmetric again.
    half = jax.lax.rsqrt(1 + jnp.sum(vector * along, axis=1))[:, None] * along
    return inverse - half[:, :, None] * half[:, None, :]
