"""TimSim: see a body move. Films and still pictures of recorded motions of any MuJoCo model.

Muscles are tubes along their wrapped path, pale while silent and strong red while firing. Pictures are rendered with
OpenGL where it works and drawn with matplotlib where it does not; both show the same body. Importing this package is
light: MuJoCo, matplotlib and ffmpeg load with the first picture.
"""

from motorgrad.sim._drawing import Drawing, draw
from motorgrad.sim._film import Film, film, still
from motorgrad.sim._gl import gl_problem
from motorgrad.sim._motion import Motion
from motorgrad.sim._painter import Painter

__all__ = ["Drawing", "Film", "Motion", "Painter", "draw", "film", "gl_problem", "still"]
