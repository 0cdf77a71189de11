"""The three-dimensional scene of TimSim's page and the cameras that look at it, drawn in the browser by viser."""

from timsim.scene._beside import BODY_COLOURS, main_metric
from timsim.scene._cameras import Cameras, camera_named, viewpoint_of
from timsim.scene._contacts import touches, weight_arrow
from timsim.scene._guard import Guard
from timsim.scene._layer import Layer
from timsim.scene._own import own, own_elements, watches
from timsim.scene._pose import Pose
from timsim.scene._scene import Scene, View
from timsim.scene._units import observation_units, unit_of

__all__ = [
    "BODY_COLOURS",
    "Cameras",
    "Guard",
    "Layer",
    "Pose",
    "Scene",
    "View",
    "camera_named",
    "main_metric",
    "observation_units",
    "own",
    "own_elements",
    "touches",
    "unit_of",
    "viewpoint_of",
    "watches",
    "weight_arrow",
]
