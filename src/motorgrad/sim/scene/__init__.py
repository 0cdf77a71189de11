"""What the page of TimSim shows in three dimensions, and the cameras that look at it; in the browser, through viser."""

from motorgrad.sim.scene._pose import Pose
from motorgrad.sim.scene._scene import Scene

__all__ = ["Pose", "Scene"]
