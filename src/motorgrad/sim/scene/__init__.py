"""The three-dimensional scene of TimSim's page and the cameras that look at it, drawn in the browser by viser."""

from motorgrad.sim.scene._beside import BODY_COLOURS, main_reading
from motorgrad.sim.scene._cameras import Cameras, camera_named, viewpoint_of
from motorgrad.sim.scene._contacts import touches, weight_arrow
from motorgrad.sim.scene._guard import Guard
from motorgrad.sim.scene._layer import Layer
from motorgrad.sim.scene._own import own, own_elements, watches
from motorgrad.sim.scene._pose import Pose
from motorgrad.sim.scene._scene import Scene, View
from motorgrad.sim.scene._units import with_unit

__all__ = [
    "BODY_COLOURS",
    "Cameras",
    "Guard",
    "Layer",
    "Pose",
    "Scene",
    "View",
    "camera_named",
    "main_reading",
    "own",
    "own_elements",
    "touches",
    "viewpoint_of",
    "watches",
    "weight_arrow",
    "with_unit",
]
