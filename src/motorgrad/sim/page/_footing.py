"""Where the feet of who walks through a scene are, on ground that is no plane of the model."""

from collections.abc import Callable
from typing import Any

import numpy as np

from motorgrad.sim.planet import Frame, OnPlanet

Footing = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]


def footing_on(task: Any, model: Any, pose: Any) -> Footing | None:
    """On a planet, the function from a place `(3,)` to the point of the ground under it and the way up there, in the
    coordinates of the scene; None elsewhere."""
    body = getattr(task, "dynamics", None)
    if model is None or not isinstance(body, OnPlanet):
        return None
    surface, first = body.planet.surface, int(model.joint("planet").qposadr[0])

    def footing(place: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        frame, offset = Frame.of_pose(pose.bodies[0].qpos[first : first + 7]), pose.offset[0]
        way = surface.ellipsoid.foot(frame.to_planet(np.asarray(place) - offset))
        ground = frame.to_local(surface.points(way)) + offset
        return ground, frame.rotation @ surface.ellipsoid.normals(way)

    return footing
