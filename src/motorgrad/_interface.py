"""What the numbers of a policy mean outside of its task: the scale of observations, the code of actions.

A policy sees scaled numbers, and its actions are codes. Its interface leads from the raw observation of the
environment, in its own units, to what the policy sees, and from the policy's action to the raw action. It is data, so
that it can be stored; and pure functions, so that it can be exported together with the policy.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from motorgrad._codes import ActionCode as ActionCode
from motorgrad._codes import ObservationCode as ObservationCode
from motorgrad._errors import check, check_positive
from motorgrad._running import RunningMean


class Statistics(NamedTuple):
    """The running mean and variance of raw observations, seeds leading where there are several."""

    mean: RunningMean
    variance: RunningMean


class Interface(eqx.Module):
    """What the observations and actions of a policy mean in the environment, as a task says it.

    - `observations`: names, order, shape and fixed scale of observations, and which have running statistics.
    - `actions`: kind, names, range and code of actions.
    - `period` (s): simulated time between two decisions, 1 without time.
    - `statistics`: the running mean, variance and count of observations; `None` where no number has any.

    `encode` and `decode` are pure functions, which JAX can trace. A pytree whose leaves are the statistics.
    """

    observations: ObservationCode = eqx.field(static=True)
    actions: ActionCode = eqx.field(static=True)
    period: float = eqx.field(static=True, default=1.0)
    statistics: Statistics | None = None

    @property
    def running(self) -> bool:
        """Whether some observations are scaled by running statistics."""
        return bool(self.observations.running.any())

    def encode(self, raw: Float[Array, " size"]) -> Float[Array, " seen"]:
        """What the policy sees of a raw observation, flattened."""
        mean, variance = (None, None) if self.statistics is None else self.statistics
        return self.observations.encode(mean, variance, raw)

    def decode(self, action: Array) -> Array:
        """The raw action, flattened, for an action of the policy; a single number for an environment that takes one."""
        self.actions.check_traceable()
        raw = self.actions.decode(action, jnp)
        return raw if self.actions.shape or self.actions.form == "same" else jnp.reshape(raw, ())

    def with_statistics(self, statistics: Statistics | None) -> "Interface":
        """The interface with other statistics."""
        return Interface(self.observations, self.actions, self.period, statistics)

    def fresh(self, seeds: int) -> "Interface":
        """The interface before any observation, seeds leading."""
        mean, variance = self.observations.start()
        if mean is None or variance is None:
            return self.with_statistics(None)
        nothing = Statistics(mean, variance)
        return self.with_statistics(jax.tree.map(lambda x: np.zeros((seeds, *x.shape), x.dtype), nothing))

    @property
    def shapes(self) -> "Interface":
        """The interface with placeholders for one seed's statistics."""
        if not self.running:
            return self.with_statistics(None)
        return jax.eval_shape(lambda: self.with_statistics(Statistics(*self.observations.start())))  # type: ignore[arg-type]

    def table(self) -> dict[str, Any]:
        """All but the statistics as a table that JSON can hold."""
        return {"observations": self.observations.table(), "actions": self.actions.table(), "period": self.period}

    @classmethod
    def of_table(cls, table: Mapping[str, Any], where: str = "interface") -> "Interface":
        """The inverse of `table`, without statistics. **Raises** `ValueError` that names what is wrong."""
        known = {"observations", "actions", "period"}
        check(isinstance(table, dict) and table.keys() == known, where, table, f"a table of {', '.join(sorted(known))}")
        observations = ObservationCode.of_table(table["observations"], f"{where}.observations")
        actions = ActionCode.of_table(table["actions"], f"{where}.actions")
        check_positive(f"{where}.period", table["period"])
        return cls(observations, actions, float(table["period"]))

    def check_statistics(self, where: str) -> None:
        """Refuse statistics that no observations have. **Raises** `ValueError`."""
        check((self.statistics is not None) == self.running, where, "no statistics", "the statistics of observations")
        if self.statistics is not None:
            for name, part in zip(("mean", "variance"), self.statistics, strict=True):
                finite = all(np.isfinite(each).all() for each in (part.mean, part.carry))
                check(finite, f"{where}.{name}", "not all finite", "finite numbers")
            least = np.asarray(self.statistics.variance.mean)
            check((least >= 0).all(), f"{where}.variance", float(least.min()) if least.size else 0.0, "at least 0")

    def check_carries(self, given: "Interface", where: str) -> None:
        """Refuse the interface of a policy whose observations or actions differ from those of a task, whose interface
        this is, but for ranges of actions. **Raises** `ValueError` that says which numbers differ, in number, order,
        name or scale."""
        found = self.differences(given)
        if found:
            raise ValueError(
                f"{where}: must have the observations and actions that the policy was learned with; there are now "
                f"{'; '.join(found)}"
            )

    def differences(self, before: "Interface") -> list[str]:
        """How observations and actions differ from those of `before`, in words."""
        pairs = (("observations", before.observations, self.observations), ("actions", before.actions, self.actions))
        found: list[str] = []
        for what, then, now in pairs:
            numbers = then.size, now.size
            if then.names == now.names and numbers[0] == numbers[1]:
                continue
            gone = [name for name in then.names if name not in now.names]
            more = [name for name in now.names if name not in then.names]
            changes = [f"without {_listed(gone)}"] * bool(gone) + [f"with {_listed(more)}"] * bool(more)
            count = f"{numbers[1]} {what} in place of {numbers[0]}" if numbers[0] != numbers[1] else f"other {what}"
            found.append(", ".join([count, *(changes or ["in another order"] * (numbers[0] == numbers[1]))]))
        kinds = before.actions.kind, self.actions.kind
        if kinds[0] != kinds[1]:
            found.append(f"{_kind(kinds[1])} actions in place of {_kind(kinds[0])} ones")
        return found or [*_scales(before.observations, self.observations), *_codes(before.actions, self.actions)]


def _scales(then: ObservationCode, now: ObservationCode) -> list[str]:
    """How the scale of the same observations differs."""
    parts = [getattr(then, name) != getattr(now, name) for name in ("offset", "divisor", "running")]
    different = np.flatnonzero(np.any(parts, axis=0))
    found = []
    if different.size:
        first = int(different[0])
        scales = [
            "running statistics" if each.running[first] else f"({each.offset[first]:g}, {each.divisor[first]:g})"
            for each in (then, now)
        ]
        which = _listed([now.names[place] for place in different])
        found.append(f"another scale of {which}: {scales[1]} in place of {scales[0]}, as (offset, divisor)")
    if then.constant != now.constant:
        found.append("an observation that is constant" if now.constant else "no observation that is constant")
    return found


def _codes(then: ActionCode, now: ActionCode) -> list[str]:
    """How the code of actions of the same names and kind differs, apart from their range."""
    same = all(np.array_equal(getattr(then, name), getattr(now, name)) for name in ("matrix", "start"))
    forms = [each.form for each in (then, now)]
    plain = {*forms} <= {"same", "clip"}
    return [] if plain or (same and forms[0] == forms[1]) else [f"another code of actions, {forms[1]!r}"]


def _kind(kind: str | tuple[str, ...]) -> str:
    return kind if isinstance(kind, str) else " and ".join(dict.fromkeys(kind))


def _listed(names: Sequence[str]) -> str:
    """Names in a line, of many the first."""
    more = f" and {len(names) - 6} more" if len(names) > 6 else ""
    return f"{', '.join(map(repr, names[:6]))}{more}"
