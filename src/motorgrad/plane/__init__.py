"""The plane of a particle: rewards, local units, trajectories and occupancy, drawn on matplotlib axes."""

from motorgrad.plane._drawing import (
    INK,
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
from motorgrad.plane._trajectories import occupancy, trajectories

__all__ = [
    "INK",
    "DrawnPaths",
    "DrawnUnits",
    "direction_colours",
    "draw_occupancy",
    "draw_paths",
    "draw_regions",
    "draw_reward",
    "draw_units",
    "has_local_units",
    "occupancy",
    "shapes_of",
    "trajectories",
]
