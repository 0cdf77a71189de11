"""TimSim: see a body move and a learner learn. A live view in the browser (`view`), films and still pictures of
recorded motions of any MuJoCo model, and of what happens in the plane of a particle.

Muscles are tubes along their wrapped path, pale while silent and strong red while firing. Pictures are rendered with
OpenGL where it works and drawn with matplotlib where it does not; both show the same body. Importing this package is
light: MuJoCo, matplotlib, JAX and ffmpeg load with the first picture.
"""

from motorgrad.sim._drawing import Drawing, draw
from motorgrad.sim._film import Film, film, still
from motorgrad.sim._gl import gl_problem
from motorgrad.sim._motion import Motion
from motorgrad.sim._painter import Painter
from motorgrad.sim._plane import (
    DrawnPaths,
    DrawnUnits,
    draw_occupancy,
    draw_paths,
    draw_regions,
    draw_reward,
    draw_units,
)
from motorgrad.sim._plane_course import Course
from motorgrad.sim._plane_film import film_learning
from motorgrad.sim._plane_paths import occupancy, trajectories
from motorgrad.sim._view import view

__all__ = [
    "Course",
    "Drawing",
    "DrawnPaths",
    "DrawnUnits",
    "Film",
    "Motion",
    "Painter",
    "draw",
    "draw_occupancy",
    "draw_paths",
    "draw_regions",
    "draw_reward",
    "draw_units",
    "film",
    "film_learning",
    "gl_problem",
    "occupancy",
    "still",
    "trajectories",
    "view",
]
