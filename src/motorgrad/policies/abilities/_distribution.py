"""Policies that know more of their distribution: its temperature, all its actions, where units respond, its entropy."""

from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, TypeVar, runtime_checkable

import numpy as np
from jaxtyping import Array, Bool, Float

from motorgrad.policies._parameters import Parametric, parts_of, with_parts
from motorgrad.policies.abilities._delegation import ActsByAnother

if TYPE_CHECKING:
    from motorgrad.policies._policy import Policy

P = TypeVar("P", bound=Parametric)


class Regions(NamedTuple):
    """Where local units respond, as NumPy arrays with one row per unit.

    `centre`; `axes`, whose columns are the half axes; `box`: true for boxes, false for ellipsoids; `active`: false for
    units that a mask has switched off. A region consists of `centre + axes @ e`, with the numbers of `e` from -1 to 1
    for a box, and its length at most 1 for an ellipsoid.
    """

    centre: Float[np.ndarray, "units inputs"]
    axes: Float[np.ndarray, "units inputs inputs"]
    box: Bool[np.ndarray, " units"]
    active: Bool[np.ndarray, " units"]


@runtime_checkable
class Temperature(Protocol):
    """Units whose randomness is set by a temperature."""

    def with_temperature(self, factor: float | Float[Array, ""]) -> Any:
        r"""The policy with the temperature of its units multiplied by `factor`.

        Where a unit fires with probability $\sigma(\phi)$, the temperature divides $\phi$. Graded units multiply their
        own noise $e^\lambda$ by `factor`, soft spheres divide their hardness by it. All other parameters stay as they
        are. Parameters may have any leading axes of seeds.
        """
        ...


@runtime_checkable
class LocalRegions(Protocol):
    """Units that respond in a region of the observations."""

    def regions(self) -> Regions | None:
        """Where each unit responds, or `None` if some unit is not local."""
        ...


@runtime_checkable
class FiniteActions(Protocol):
    """A policy with finitely many actions."""

    def enumerate(self) -> Array:
        """All actions along a leading axis, for exact sums."""
        ...


@runtime_checkable
class EntropyEstimate(Protocol):
    """A policy whose entropy is cheaper to estimate than to compute."""

    def entropy_estimate(
        self, observation: Float[Array, " inputs"], uniforms: Float[Array, " uniforms"]
    ) -> Float[Array, ""]:
        """An estimate of the entropy in nats, from the random numbers of one `sample`."""
        ...


def has_temperature(policy: Parametric) -> bool:
    """Whether `with_temperature` changes the policy: whether it or one of its parts has a temperature."""
    return isinstance(policy, Temperature) or any(map(has_temperature, parts_of(policy)))


def with_temperature(policy: P, factor: float | Float[Array, ""]) -> P:
    """The policy with the temperature of its units multiplied by `factor`, in all its parts. Units without a
    temperature stay as they are. Parameters may have any leading axes of seeds."""
    if isinstance(policy, Temperature):
        return policy.with_temperature(factor)
    return with_parts(policy, [with_temperature(part, factor) for part in parts_of(policy)])


def regions(policy: object) -> Regions | None:
    """Where each unit responds, or `None` if some unit is not local."""
    return policy.regions() if isinstance(policy, LocalRegions) else None


def enumerate(policy: object) -> Array:
    """All actions along a leading axis, for exact sums.

    **Raises:** `ValueError` if there are infinitely many.
    """
    if isinstance(policy, FiniteActions):
        return policy.enumerate()
    if isinstance(policy, ActsByAnother):
        return enumerate(policy.inner)
    raise ValueError(f"{type(policy).__name__}: has infinitely many actions: real numbers")


def entropy_estimate(
    policy: "Policy", observation: Float[Array, " inputs"], uniforms: Float[Array, " uniforms"]
) -> Float[Array, ""]:
    """An estimate of the entropy in nats, from the random numbers of one `sample`, for learners that average over many
    observations. It is exact for policies whose entropy is cheap."""
    if isinstance(policy, EntropyEstimate):
        return policy.entropy_estimate(observation, uniforms)
    return policy.entropy(observation)
