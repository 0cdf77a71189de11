"""Every seed's own policy to begin from, in place of the agent's."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from motorgrad._errors import check
from motorgrad.policies import Policy, trainable
from motorgrad.training.store._checkpoint import name_of


def stacked(initial: Any, like: Policy, seeds: int) -> Policy:
    """The policies that seeds begin from, along a leading axis, in the types of the agent's.

    **Arguments:** `initial`, as `train` takes it; `like`, the shapes of one policy of the agent; how many seeds.

    **Raises** `ValueError` that names what is of another structure or shape than the agent's, or not finite.
    """
    wanted = "policies of all seeds along a leading axis, such as the policies of a run, or None"
    check(isinstance(initial, Policy), "initial", initial, wanted)
    kinds = [type(policy).__name__ for policy in (initial, like)]
    check(type(initial) is type(like), "initial", kinds[0], f"of the kind of the agent's policy, {kinds[1]}")
    places = [dict(jax.tree_util.tree_leaves_with_path(policy)) for policy in (initial, like)]
    parts = [sorted(map(name_of, place)) for place in places]
    check(parts[0] == parts[1], "initial", parts[0], f"of the parts of the agent's policy, {parts[1]}")

    def fitting(place: Any, leaf: Any) -> jax.Array:
        name, given = f"initial.{name_of(place)}", places[0][place]
        check(np.shape(given) == (seeds, *leaf.shape), f"{name}.shape", np.shape(given), f"{(seeds, *leaf.shape)}")
        return jnp.asarray(given, leaf.dtype)

    found = jax.tree_util.tree_map_with_path(fitting, like)
    for place, leaf in jax.tree_util.tree_leaves_with_path(trainable(found)):
        finite = bool(jnp.isfinite(leaf).all())
        check(finite, f"initial.{name_of(place)}", "not all finite", "finite numbers")
    return found
