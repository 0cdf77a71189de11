"""The sets of curves that a Hill-type muscle may have, and its functions with one of them."""

import dataclasses
import types
from collections.abc import Callable, Mapping
from typing import Any

from motorgrad._arrays import Real
from motorgrad._errors import choice
from motorgrad.bodies.muscles import _hill_curves, _millard_curves
from motorgrad.bodies.muscles._hill_curves import STRAIN
from motorgrad.bodies.muscles._hill_dynamics import FUNCTIONS


@dataclasses.dataclass(frozen=True)
class HillCurves:
    """The four curves of a Hill-type muscle. Each is a function of numbers or arrays.

    **Attributes:**

    - `active_tangent`, `passive_tangent`, `velocity_tangent`: the curve and its slope.
    - `tendon_tangent`: likewise, of a length and of what `tendon_stiffness` makes of a strain.
    - `helpers`: functions that these call.
    """

    active_tangent: Callable[[Any], tuple[Any, Any]]
    passive_tangent: Callable[[Any], tuple[Any, Any]]
    velocity_tangent: Callable[[Any], tuple[Any, Any]]
    tendon_tangent: Callable[[Any, Any], tuple[Any, Any]]
    tendon_stiffness: Callable[[Any], Any]
    helpers: tuple[Callable[..., Any], ...] = ()

    def active_force_length(self, length: Real) -> Any:
        """The active force of a fiber at rest and at full activation, as a multiple of the greatest isometric force,
        at a length as a multiple of the optimal one."""
        return self.active_tangent(length)[0]

    def passive_force_length(self, length: Real) -> Any:
        """The force of a passive fiber, likewise."""
        return self.passive_tangent(length)[0]

    def force_velocity(self, velocity: Real) -> Any:
        """The factor by which a velocity changes the active force; the velocity is a multiple of the greatest, and
        negative while the fiber shortens."""
        return self.velocity_tangent(velocity)[0]

    def tendon_force_length(self, length: Real, strain: Real = STRAIN) -> Any:
        """The force of a tendon as a multiple of the greatest isometric force, at a length as a multiple of its slack
        length; `strain` is that at the greatest force."""
        return self.tendon_tangent(length, self.tendon_stiffness(strain))[0]


def _of(module: types.ModuleType, *helpers: Callable[..., Any]) -> HillCurves:
    """The curves of a module, whose functions have the names of the fields."""
    named = [field.name for field in dataclasses.fields(HillCurves) if field.name != "helpers"]
    return HillCurves(**{name: getattr(module, name) for name in named}, helpers=helpers)


CURVES: Mapping[str, HillCurves] = {
    "de-groote": _of(_hill_curves),
    "millard": _of(_millard_curves, _millard_curves.tabulated),
}
"""The sets of curves by name. A model stores the number of a set in this order, so new ones go to the end."""


def hill_curves(name: str = "de-groote") -> HillCurves:
    """The curves of a Hill-type muscle by their name.

    **Arguments:** `name`: `"de-groote"` for those of De Groote et al. (2016), which `active_force_length` and its
    siblings explain; `"millard"` for those of Millard et al. (2013), quintic Bézier curves with the numbers of
    OpenSim's `Millard2012EquilibriumMuscle`, accurate to 1e-8.

    **Raises:** `ValueError` for another name.

    ```python
    curves = mg.bodies.hill_curves("millard")
    print(curves.force_velocity(0.0), curves.passive_force_length(1.7).round(9))  # → 1.0 1.0
    ```
    """
    choice("curves", name, CURVES)
    return CURVES[name]


def with_curves(
    name: str,
    make: Callable[[Any], Any] = lambda function: function,
    instead: Mapping[str, Any] = types.MappingProxyType({}),
    **scope: object,
) -> types.SimpleNamespace:
    """The functions of Hill-type muscles that have some curves.

    **Arguments:**

    - `name`: name of the curves.
    - `make`: what to make of each function, such as a compiled one.
    - `instead`: functions in place of those of the same name.
    - `scope`: names that replace those of the functions' modules, such as another `np`.

    **Returns:** an object with the functions by name. They call each other, and not those of their modules.
    """
    curves = hill_curves(name)
    found = dict(scope)
    own = (curves.active_tangent, curves.passive_tangent, curves.velocity_tangent, curves.tendon_tangent)
    for function in (*curves.helpers, *own, *FUNCTIONS):
        code: Any = instead.get(function.__name__, function)
        copy = types.FunctionType(code.__code__, {**code.__globals__, **found}, code.__name__, code.__defaults__)
        found[function.__name__] = make(copy)
    return types.SimpleNamespace(**found, tendon_stiffness=curves.tendon_stiffness)
