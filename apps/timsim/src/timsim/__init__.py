"""TimSim: live views of bodies and learners in the browser, and films and still pictures of recorded motions.

`view` opens a live page. `write_film`, `write_replay`, `still` and `draw` show recorded motions of any MuJoCo model,
and `animate` how a particle learned.

Muscles are tubes along their wrapped path, pale pink while silent and strong red while active. Pictures are rendered
with OpenGL where it works and drawn with matplotlib otherwise; both show the same body. Importing this is cheap;
MuJoCo, matplotlib, JAX and ffmpeg load with the first picture.
"""

from timsim._view import view
from timsim.film import (
    Drawing,
    Film,
    Motion,
    Painter,
    Viewpoint,
    draw,
    gl_problem,
    motion_of,
    read_activations,
    read_motion,
    still,
    write_film,
)
from timsim.plane import (
    Course,
    animate,
    course_of,
    film_learning,
)
from timsim.replay import Plot, Replay, write_replay

__all__ = [
    "Course",
    "Drawing",
    "Film",
    "Motion",
    "Painter",
    "Plot",
    "Replay",
    "Viewpoint",
    "animate",
    "course_of",
    "draw",
    "film_learning",
    "gl_problem",
    "motion_of",
    "read_activations",
    "read_motion",
    "still",
    "view",
    "write_film",
    "write_replay",
]
