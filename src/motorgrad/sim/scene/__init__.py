"""What the page of TimSim shows in three dimensions, and the cameras that look at it; in the browser, through viser."""

from motorgrad.sim.scene._cameras import Cameras
from motorgrad.sim.scene._layer import Layer
from motorgrad.sim.scene._pose import Pose
from motorgrad.sim.scene._scene import Scene
from motorgrad.sim.scene._view import View

__all__ = ["Cameras", "Layer", "Pose", "Scene", "View"]
