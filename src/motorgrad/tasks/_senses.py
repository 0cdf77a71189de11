"""What a pool senses of a load: the load itself, or what its muscle can feel of it (section 4.3 of the thesis)."""

import math
from typing import Literal

import jax.numpy as jnp
from jax.scipy.special import ndtri
from jaxtyping import Array, Float

from motorgrad._arrays import Real
from motorgrad._random import MIN_UNIFORM

Sense = Literal["load", "strain", "lifts", "nothing"]

FULL_STRAIN = 4.9
"""The strain of a tendon at the muscle's greatest isometric force, in %."""
_SOFT = 5.0  # 1 / c1 of the tendon's curve, and its c3 / c1 is 1


def strain(pull: Real) -> Float[Array, "..."]:
    r"""The strain of a tendon on which a load hangs at rest, in % of its slack length.

    The tendon is that of `motorgrad.bodies.tendon_force_length` (De Groote et al., 2016, with the coefficients of
    OpenSim), solved for its length: $4.9 \ln(1 + 5 f) / \ln 6$ for the pull $f$. It is six times as stiff at the
    muscle's greatest force as at none.

    **Arguments:** `pull`, as a multiple of the muscle's greatest isometric force. A tendon that is not pulled is slack.

    **Returns:** the strain in %: 0 for a pull of 0 or less, 4.9 for a pull of 1.
    """
    return FULL_STRAIN * jnp.log1p(_SOFT * jnp.maximum(pull, 0.0)) / math.log1p(_SOFT)


def noisy(felt: Float[Array, ""], noise: float, uniforms: Float[Array, " numbers"]) -> Float[Array, ""]:
    """What is felt, with normal noise of this standard deviation, drawn by a number from U[0, 1); by none without
    noise."""
    return felt + noise * ndtri(jnp.maximum(uniforms[0], MIN_UNIFORM)) if noise else felt


def strain_rates(gain: float, threshold: float, heaviest: float) -> dict[str, float]:
    """Step sizes on an axis of strains, from those on one of loads up to the heaviest: with them gradient ascent makes
    the same steps on both, as far as strains are in proportion to loads."""
    unit = FULL_STRAIN / heaviest
    return {"gain": gain / unit**2, "threshold": threshold * unit**2}
