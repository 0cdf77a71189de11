"""TimSim: live views of bodies and learners in the browser, films and still pictures of recorded motions, and drawings
of what a particle learns in its plane.

`view` opens a live page. `write_film`, `write_replay`, `still` and `draw` show recorded motions of any MuJoCo model;
`draw_reward`, `draw_units`, `draw_paths` and `draw_occupancy` show the plane of a particle.

Muscles are tubes along their wrapped path, pale pink while silent and strong red while active. Pictures are rendered
with OpenGL where it works and drawn with matplotlib otherwise; both show the same body. Importing this is cheap;
MuJoCo, matplotlib, JAX and ffmpeg load with the first picture.
"""

from motorgrad.sim._view import view
from motorgrad.sim.film import (
    Drawing,
    Film,
    Motion,
    Painter,
    Viewpoint,
    draw,
    gl_problem,
    read_activations,
    read_motion,
    still,
    write_film,
)
from motorgrad.sim.plane import (
    Course,
    DrawnPaths,
    DrawnUnits,
    draw_occupancy,
    draw_paths,
    draw_regions,
    draw_reward,
    draw_units,
    film_learning,
    occupancy,
    trajectories,
)
from motorgrad.sim.replay import Plot, Replay, write_replay

__all__ = [
    "Course",
    "Drawing",
    "DrawnPaths",
    "DrawnUnits",
    "Film",
    "Motion",
    "Painter",
    "Plot",
    "Replay",
    "Viewpoint",
    "draw",
    "draw_occupancy",
    "draw_paths",
    "draw_regions",
    "draw_reward",
    "draw_units",
    "film_learning",
    "gl_problem",
    "occupancy",
    "read_activations",
    "read_motion",
    "still",
    "trajectories",
    "view",
    "write_film",
    "write_replay",
]
