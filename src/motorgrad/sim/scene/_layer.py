"""What every layer of the scene has: a name to switch it by, pools to draw with."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from motorgrad.sim.scene._pool import Pool

if TYPE_CHECKING:
    import viser

    from motorgrad.sim.live import Session
    from motorgrad.sim.scene._pose import Pose


class Layer:
    """Draws something about the bodies in view, and can be switched off; switched off, it costs nothing.

    A subclass says in `build` whether it `applies` and makes its `pools`; `draw` assigns to them.

    **Attributes:** `name`, of its switch, empty where it always shows; `applies`, whether there is anything to draw;
    `pools`.
    """

    name = ""

    def __init__(self, shown: bool = True) -> None:
        self._shown = shown
        self.applies = False
        self.pools: list[Pool] = []

    @property
    def shown(self) -> bool:
        """Whether it is switched on."""
        return self._shown

    @shown.setter
    def shown(self, value: bool) -> None:
        self._shown = value
        self.switch(value)

    def switch(self, shown: bool) -> None:
        """Show or hide what was drawn."""
        for pool in self.pools:
            pool.visible = shown

    def build(self, server: viser.ViserServer, session: Session) -> None:
        """Add the nodes, once."""
        raise NotImplementedError

    def grips(self) -> list[tuple[Any, np.ndarray]]:
        """What can be taken hold of: viser's handles, and of which geom each copy is."""
        return []

    def draw(self, pose: Pose) -> None:
        """Show the present moment; called only where the layer applies and is shown."""
