"""A round world to walk on. Each camera sees it as finely as it needs; a body feels a patch of ground around it.

`Planet` holds the settings, `on_planet` moves a task there, `PlanetBatch` is the physics, and `PlanetScene` draws the
planet in the page. Nothing else of TimSim imports this package unless a planet is asked for.
"""

from timsim.planet._body import OnPlanet, PlanetBatch, on_planet
from timsim.planet._geometry import Frame
from timsim.planet._planet import Detail, Planet
from timsim.planet._scene import PlanetScene, ground_finder

__all__ = ["Detail", "Frame", "OnPlanet", "Planet", "PlanetBatch", "PlanetScene", "ground_finder", "on_planet"]
