"""A body somewhere else than on its own ground."""

import dataclasses
from collections.abc import Mapping

from motorgrad.bodies._body import Body
from motorgrad.bodies._muscle import Muscle
from motorgrad.bodies._servo import Servo


@dataclasses.dataclass(frozen=True)
class WrappedBody:
    """What a body in other surroundings has of the body itself. Subclasses give the `spec`.

    **Arguments:** `body`.
    """

    body: Body

    @property
    def muscles(self) -> tuple[Muscle, ...]:
        """The body's."""
        return self.body.muscles

    @property
    def servos(self) -> tuple[Servo, ...]:
        """The body's, if it has any."""
        return getattr(self.body, "servos", ())

    @property
    def groups(self) -> tuple[str, ...]:
        """The body's."""
        return self.body.groups

    @property
    def sensor_components(self) -> Mapping[str, int]:
        """The body's."""
        return self.body.sensor_components
