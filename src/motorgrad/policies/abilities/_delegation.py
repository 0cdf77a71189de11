"""Policies that act by another one, whose abilities are theirs."""

from typing import TYPE_CHECKING, Protocol, runtime_checkable

from jaxtyping import Array, Float

if TYPE_CHECKING:
    from motorgrad.policies._policy import Policy


@runtime_checkable
class ActsByAnother(Protocol):
    r"""A policy that acts by another one on what that sees, $\pi(a \mid y) = \pi'(a \mid \varphi(y))$.

    What follows from this needs no method: its hidden units (`task_action`), all its actions (`enumerate`) and its
    Fisher coordinates are those of the other policy.
    """

    @property
    def inner(self) -> "Policy":
        r"""The other policy."""
        ...

    def seen(self, observation: Float[Array, " inputs"]) -> Float[Array, " features"]:
        r"""$\varphi(y)$, what the other policy sees."""
        ...

    def acting(self, observation: Float[Array, " inputs"]) -> "Policy":
        r"""$\pi'$, the policy that acts on an observation: `inner`, or one that depends on the observation."""
        ...
