"""The goal of a composed task, found in its terms."""

import itertools
from collections.abc import Sequence

import jax.numpy as jnp
from jaxtyping import Array, Float

from motorgrad._goal import Goal
from motorgrad.tasks._task import Scalar
from motorgrad.tasks.terms import (
    Beyond,
    Bound,
    JointPositions,
    Observation,
    Positions,
    Quantity,
    Scene,
    TargetError,
    TargetPosition,
)
from motorgrad.tasks.terms._quantities import OfDistance
from motorgrad.tasks.terms._term import norm


def goal_of(
    observations: Sequence[Observation | Quantity],
    observed: Sequence[tuple[float, Bound]],
    rewards: Sequence[Quantity],
    scene: Scene,
) -> Goal | None:
    """The goal of a task, or none.

    A task has a goal if it has one target, which stays where it is; if observations show its error once, and of other
    terms that depend on the target at most its position, with the same scale; and if rewards depend on it by their
    distance alone, but for a penalty beyond a limit.

    **Arguments:** the terms of the `observations`; what they are on the body, each with its scale; the terms of the
    `rewards`; the `scene` with the targets.
    """
    if len(scene.targets) != 1:
        return None
    ((target_name, target),) = scene.targets.items()
    ends = list(itertools.accumulate((len(bound.names) for _, bound in observed), initial=0))
    seen = [
        (term, scale, bound.names, tuple(range(*ends)))
        for term, (scale, bound), ends in zip(observations, observed, itertools.pairwise(ends), strict=True)
    ]
    aimed = [each for each in seen if getattr(each[0], "target", None) == target_name]
    shown = {type(term): (scale, places) for term, scale, _, places in aimed}
    if len(shown) < len(aimed):
        return None
    scale, errors = shown.pop(TargetError, (0.0, ()))
    same, targets = shown.pop(TargetPosition, (scale, ()))
    if target.moves or shown or scale == 0 or same != scale:
        return None
    paid = [term for term in rewards if getattr(term, "target", None) == target_name]
    distances = [term for term in paid if isinstance(term, OfDistance)]
    if not distances or not all(isinstance(term, OfDistance | Beyond) for term in paid):
        return None

    def reward(error: Float[Array, " errors"]) -> Scalar:
        distance = norm(error / scale)
        return jnp.asarray(sum(term.weight * term.of(distance) for term in distances))

    positions = {
        name: place
        for term, own, names, places in seen
        if isinstance(term, Positions | JointPositions) and own == scale
        for name, place in zip(names, places, strict=True)
    }
    actual = tuple(positions[name] for name in target.shown if name in positions)
    return Goal(errors, reward, targets, actual if len(actual) == len(errors) else ())
