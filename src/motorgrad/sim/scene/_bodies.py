"""The parts of bodies that are spheres, ellipsoids, capsules, cylinders and boxes."""

# pyright: reportAttributeAccessIssue=false
# (the bindings of mujoco carry no types)
from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from motorgrad.sim import _framing
from motorgrad.sim._colours import geom_colours
from motorgrad.sim.scene import _turns
from motorgrad.sim.scene._layer import Layer
from motorgrad.sim.scene._pool import Pool
from motorgrad.sim.scene._shapes import Shape, ball, block, rod

if TYPE_CHECKING:
    import mujoco
    import viser

    from motorgrad.sim.live import Session
    from motorgrad.sim.scene._pose import Pose


APART = 0.02  # of its radius a ball is larger than the one before; more than its facets depart from the sphere


class Pieces(NamedTuple):
    """Copies of one unit shape: of `geom` `(n,)`, `shift` `(n,)` m along its own z, of `size` `(n, 3)`."""

    geom: np.ndarray
    shift: np.ndarray
    size: np.ndarray


class Bodies(Layer):
    """Geoms as copies of three unit meshes: a capsule is a rod and two balls.

    So the number of messages does not grow with the body, and only places and turns are sent.
    """

    def build(self, server: viser.ViserServer, session: Session) -> None:
        self._parts: list[tuple[Pool, Pieces, np.ndarray]] = []
        model = session.model
        if model is None:
            return
        colours = geom_colours(model)
        for kind, shape, pieces in _pieces(model):
            for clear in (False, True):
                chosen = (colours[pieces.geom, 3] < 1) == clear
                if not chosen.any():
                    continue
                some = Pieces(*(column[chosen] for column in pieces))
                node = f"/bodies/{kind}{'/clear' if clear else ''}"
                pool = Pool(server.scene, node, shape, len(some.geom), shadow=not clear, faded=clear)
                self._parts.append((pool, some, colours[some.geom]))
        self.pools = [pool for pool, *_ in self._parts]
        self.applies = bool(self.pools)

    def grips(self) -> list[tuple[Any, np.ndarray]]:
        """What can be taken hold of: viser's handles, and of which geom each copy is."""
        return [(pool.handle, pieces.geom) for pool, pieces, _ in self._parts if pool.handle is not None]

    def draw(self, pose: Pose) -> None:
        for pool, pieces, colours in self._parts:
            rows = [
                _placed(data, offset, pieces, colours) for data, offset in zip(pose.bodies, pose.offset, strict=True)
            ]
            pool.show(*(np.concatenate(column) for column in zip(*rows, strict=True)))


def _placed(data: mujoco.MjData, offset: np.ndarray, pieces: Pieces, colours: np.ndarray) -> tuple[np.ndarray, ...]:
    turn = data.geom_xmat[pieces.geom].reshape(-1, 3, 3)
    place = data.geom_xpos[pieces.geom] + pieces.shift[:, None] * turn[:, :, 2] + offset
    return place, _turns.of_matrices(turn), pieces.size, colours[:, :3], colours[:, 3]


def _pieces(model: mujoco.MjModel) -> Iterator[tuple[str, Shape, Pieces]]:
    """What is copied how often, by unit shape."""
    import mujoco

    kinds = mujoco.mjtGeom
    seen = _framing.visible_geoms(model)

    def of(kind: int) -> tuple[np.ndarray, np.ndarray]:
        geoms = seen[model.geom_type[seen] == kind]
        return geoms, model.geom_size[geoms]

    spheres, sphere = of(kinds.mjGEOM_SPHERE)
    eggs, egg = of(kinds.mjGEOM_ELLIPSOID)
    capsules, capsule = of(kinds.mjGEOM_CAPSULE)
    cylinders, cylinder = of(kinds.mjGEOM_CYLINDER)
    boxes, box = of(kinds.mjGEOM_BOX)
    none, half = np.zeros(len(capsules)), capsule[:, 1]
    # where two limbs meet their ends are the same ball, of two colours: one is drawn over the other
    ends = capsule[:, [0, 0, 0]] * (1 + APART * (model.geom_bodyid[capsules, None] % 3))
    yield (
        "balls",
        ball(),
        Pieces(
            np.concatenate([spheres, eggs, capsules, capsules]),
            np.concatenate([0 * sphere[:, 0], 0 * egg[:, 0], half, -half]),
            np.concatenate([sphere[:, [0, 0, 0]], egg, ends, ends]),
        ),
    )
    yield (
        "rods",
        rod(),
        Pieces(
            np.concatenate([cylinders, capsules]),
            np.concatenate([0 * cylinder[:, 0], none]),
            np.concatenate([cylinder[:, [0, 0, 1]], capsule[:, [0, 0, 1]]]) * [1, 1, 2],
        ),
    )
    yield "blocks", block(), Pieces(boxes, 0 * box[:, 0], box)
