"""What a muscle is: two attachments, a path between them, and the law of its tension."""

import dataclasses
import math
from collections.abc import Iterable
from typing import Any

import numpy as np

from motorgrad._errors import check


def tension(
    activation: Any,
    length: Any,
    velocity: Any,
    strength: Any,
    rest_length: Any,
    shape: Any = 0.5,
    damping: Any = 0.0,
) -> Any:
    r"""The tension of a muscle, positive when it pulls.

    $$F = a\, f_{max} \exp\left(-\frac{(L/r - 1)^2}{k_{CE}}\right) + k_{SE}\, \dot L$$

    This is the only place where the law is written: numba compiles this very function for the physics (see
    `install_muscle_callback`), and NumPy evaluates it for tests and figures.

    **Arguments** (floats or NumPy arrays that broadcast together):

    - `activation`: $a$, from 0 to 1.
    - `length`: $L$, the length of the path in m.
    - `velocity`: $\dot L$ in m/s, positive while the muscle is being stretched.
    - `strength`: $f_{max}$ in N.
    - `rest_length`: $r$ in m, where the contractile force is greatest.
    - `shape`: $k_{CE}$, dimensionless; the larger, the flatter the force–length curve.
    - `damping`: $k_{SE}$ in N s/m.

    **Returns:** the tension in N, of the arguments' common shape. A muscle that shortens quickly while it is silent has
    a negative tension: the damper pushes, as in the source.

    Source: the lumped-parameter muscle of the thesis behind this library, section 5.1.2.
    """
    strain = length / rest_length - 1.0
    return activation * strength * np.exp(-strain * strain / shape) + damping * velocity


@dataclasses.dataclass(frozen=True)
class Attachment:
    """A point on a body to which a muscle is fixed: the body's name and (x, y, z) in that body's frame, in m."""

    body: str
    position: tuple[float, float, float]

    def __post_init__(self) -> None:
        check(isinstance(self.body, str) and self.body, "Attachment.body", self.body, "the name of a body")
        point = tuple(float(x) for x in self.position)
        check(
            len(point) == 3 and all(map(math.isfinite, point)),
            "Attachment.position",
            self.position,
            "three finite numbers (m)",
        )
        object.__setattr__(self, "position", point)


@dataclasses.dataclass(frozen=True)
class Wrap:
    """An obstacle on a muscle's path: the name of a sphere or cylinder geom, and of the site that says on which side
    the path passes. Put the site near the middle of the arc; see the page on bodies for why."""

    geom: str
    side_site: str

    def __post_init__(self) -> None:
        check(isinstance(self.geom, str) and self.geom, "Wrap.geom", self.geom, "the name of a sphere or cylinder geom")
        check(isinstance(self.side_site, str) and self.side_site, "Wrap.side_site", self.side_site, "a site's name")


@dataclasses.dataclass(frozen=True)
class Muscle:
    """One muscle: where it runs and how strong it is.

    **Arguments:**

    - `name`: unique within the body; names the tendon and the actuator.
    - `group`: muscles of one group fire together, on one number of the action.
    - `origin`, `insertion`: the two ends; the path is the shortest one between them.
    - `strength`: greatest contractile force $f_{max}$, N, > 0.
    - `rest_length`: $r$, m, > 0.
    - `damping`: $k_{SE}$, N s/m, ≥ 0.
    - `shape`: $k_{CE}$, > 0; infinite for a contractile force that is the same at every length.
    - `wrap`: the joint capsule that the path may not cut, or None for a straight muscle.

    **Raises:** `ValueError` naming the field and its range. The law is `tension`.
    """

    name: str
    group: str
    origin: Attachment
    insertion: Attachment
    strength: float
    rest_length: float
    damping: float = 8.0
    shape: float = 0.5
    wrap: Wrap | None = None

    def __post_init__(self) -> None:
        check(isinstance(self.name, str) and self.name, "Muscle.name", self.name, "a name that is not empty")
        where = f"Muscle {self.name!r} "
        check(isinstance(self.group, str) and self.group, where + "group", self.group, "a name that is not empty")
        for field in ("strength", "rest_length"):
            positive(where + field, getattr(self, field))
        if self.shape != math.inf:
            positive(where + "shape", self.shape)
        not_negative(where + "damping", self.damping)


def positive(name: str, value: Any) -> None:
    """Refuse `value` unless it is a finite number above 0."""
    check(_is_number(value) and 0.0 < value < math.inf, name, value, "a finite number > 0")


def not_negative(name: str, value: Any) -> None:
    """Refuse `value` unless it is a finite number of at least 0."""
    check(_is_number(value) and 0.0 <= value < math.inf, name, value, "a finite number >= 0")


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(value, bool)


def groups_of(muscles: Iterable[Muscle]) -> tuple[str, ...]:
    """The groups of `muscles`, each once, in the order of first appearance: the components of an action."""
    return tuple(dict.fromkeys(muscle.group for muscle in muscles))
