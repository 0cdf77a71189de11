"""A round world to walk on: terrain as an ellipsoid in a quad-tree of height-field tiles, drawn as finely as it is
looked at, and the physics of one body on a patch of it that is laid anew as the body goes.

`Planet` holds its settings, `on_planet` puts a task there, `PlanetScene` shows it in the page.
"""

from motorgrad.sim.planet._batch import PlanetBatch
from motorgrad.sim.planet._body import OnPlanet
from motorgrad.sim.planet._frame import Frame
from motorgrad.sim.planet._planet import Detail, Planet
from motorgrad.sim.planet._scene import PlanetScene
from motorgrad.sim.planet._task import on_planet

__all__ = ["Detail", "Frame", "OnPlanet", "Planet", "PlanetBatch", "PlanetScene", "on_planet"]
