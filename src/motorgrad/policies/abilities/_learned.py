"""Policies whose parameters have limits, hold still in places, or come with statistics of the observations."""

from typing import Any, Protocol, TypeVar, runtime_checkable

from jaxtyping import Array, Float, PyTree

from motorgrad.policies._parameters import Parametric, parts_of, with_parts

P = TypeVar("P", bound=Parametric)


@runtime_checkable
class ParameterLimits(Protocol):
    """A policy whose parameters have limits."""

    def limited(self) -> Any:
        """The policy with its parameters clipped to their limits. Applied after every step."""
        ...


@runtime_checkable
class FixedEntries(Protocol):
    """A policy some of whose parameters must not move."""

    def allowed(self, step: Any) -> Any:
        """Zero the entries of a parameter step that must not move."""
        ...


@runtime_checkable
class RunningStatistics(Protocol):
    """A policy that keeps statistics of its observations."""

    def adapted(self, seen: Float[Array, " inputs"]) -> Any:
        """The policy after one more observation. A learner calls it with what an action led to."""
        ...


def limited(policy: P) -> P:
    """The policy with its parameters clipped to their limits, in all its parts."""
    if isinstance(policy, ParameterLimits):
        return policy.limited()
    return with_parts(policy, [limited(part) for part in parts_of(policy)])


def allowed(policy: Parametric, step: PyTree) -> PyTree:
    """A parameter step without the entries that must not move, in all parts of the policy."""
    if isinstance(policy, FixedEntries):
        return policy.allowed(step)
    parts = parts_of(policy)
    if not parts:
        return step
    return with_parts(step, [allowed(part, own) for part, own in zip(parts, parts_of(step), strict=True)])


def adapted(policy: Any, seen: Float[Array, " inputs"]) -> Any:
    """The policy after one more observation, for one that keeps statistics of them; the policy itself, for others. It
    concerns the parts that see the same."""
    if isinstance(policy, RunningStatistics):
        return policy.adapted(seen)
    parts = parts_of(policy)
    after = [adapted(part, seen) if part.inputs == policy.inputs else part for part in parts]
    return policy if all(new is old for new, old in zip(after, parts, strict=True)) else with_parts(policy, after)
