"""The whole scene: its layers in order."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from motorgrad.sim.scene._balance import Balance
from motorgrad.sim.scene._bodies import Bodies
from motorgrad.sim.scene._contacts import Contacts
from motorgrad.sim.scene._ground import Ground
from motorgrad.sim.scene._labels import Labels
from motorgrad.sim.scene._layer import Layer
from motorgrad.sim.scene._markers import JointAxes, Sites
from motorgrad.sim.scene._meshes import Meshes
from motorgrad.sim.scene._muscles import Muscles
from motorgrad.sim.scene._plane import Plane, PlaneUnits
from motorgrad.sim.scene._sky import Sky

if TYPE_CHECKING:
    import viser

    from motorgrad.sim.live import Session, Snapshot
    from motorgrad.sim.scene._pose import Pose


class Scene:
    """All that is drawn of a run: bodies, muscles, what they stand on, what is told about them.

    Add it once to a server, then hand it every moment. Nodes are made once; from then on only what changed is sent: of
    a hexapod with 24 muscles some 12 kB a moment with every layer on, and no more as time goes on.

    **Arguments:** `layers`, others than the usual ones, in the order in which they are built.

    **Attributes:** `layers`; each has a `name` and can be switched with `shown`.
    """

    def __init__(self, layers: list[Layer] | None = None) -> None:
        usual = [Sky(), Ground(), Bodies(), Meshes(), Muscles(), Contacts(), Balance(), Sites(), JointAxes(), Labels()]
        usual += [Plane(), PlaneUnits()]
        self.layers = usual if layers is None else layers
        self._drawn: tuple[object, ...] = ()

    def build(self, server: viser.ViserServer, session: Session) -> None:
        """Add the nodes of all layers, once."""
        self._server = server
        for layer in self.layers:
            layer.build(server, session)

    def grips(self) -> list[tuple[Any, np.ndarray]]:
        """What of all layers can be taken hold of."""
        return [grip for layer in self.layers for grip in layer.grips()]

    def update(self, snapshot: Snapshot, pose: Pose) -> None:
        """Show the present moment: all of it at once, or nothing where nothing has changed."""
        active = [layer for layer in self.layers if layer.applies and layer.shown]
        moment = (snapshot.decision, snapshot.reset_count, len(snapshot.position), *map(id, active))
        if moment == self._drawn:
            return
        self._drawn = moment
        with self._server.atomic():
            for layer in active:
                layer.draw(pose)
