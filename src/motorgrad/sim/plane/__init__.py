"""The plane of a particle: rewards, local units, trajectories and occupancy, drawn on matplotlib axes or as a film."""

from motorgrad.sim.plane._drawing import (
    DrawnPaths,
    DrawnUnits,
    direction_colours,
    draw_occupancy,
    draw_paths,
    draw_regions,
    draw_reward,
    draw_units,
    has_local_units,
    shapes_of,
)
from motorgrad.sim.plane._learning_film import Course, film_learning
from motorgrad.sim.plane._picture import Animation, PlanePicture
from motorgrad.sim.plane._trajectories import occupancy, trajectories

__all__ = [
    "Animation",
    "Course",
    "DrawnPaths",
    "DrawnUnits",
    "PlanePicture",
    "direction_colours",
    "draw_occupancy",
    "draw_paths",
    "draw_regions",
    "draw_reward",
    "draw_units",
    "film_learning",
    "has_local_units",
    "occupancy",
    "shapes_of",
    "trajectories",
]
