"""Films, still pictures and drawings of recorded motions of any MuJoCo model.

`write_film` and `still` make files, `draw` draws on matplotlib axes, `Painter` renders a motion that is still going on.
The other names are shared with the page: how a model looks, where a camera must stand, and how frames become a video.
"""

from timsim.film._annotations import Annotations, Arrow, Curve, annotate, caption
from timsim.film._appearance import (
    FIRING,
    MARK,
    MARK_OPACITY,
    SILENT,
    geom_colours,
    height_grid,
    muscle_colour,
    muscle_radius,
    muscle_width,
    tendon_activation,
    texture_of,
    texture_pixels,
)
from timsim.film._drawing import Drawing, draw, ground_height
from timsim.film._film import (
    ENDINGS,
    GAP,
    Film,
    output_path,
    rate_of,
    still,
    write_film,
    write_frames,
    write_gif,
    write_mp4,
)
from timsim.film._framing import ABOVE, Outline, bounding_box, camera_axes, natural_angles, visible_geoms
from timsim.film._gl import Ground, gl_problem
from timsim.film._motion import Motion, resample
from timsim.film._motion_file import read_activations, read_motion
from timsim.film._of_runs import motion_of
from timsim.film._painter import Painter, check_picture
from timsim.film._plots import MAX_PLOT_LINES, Plot, PlotStrip
from timsim.film._scenery import nice_step
from timsim.film._viewpoint import Camera, Viewpoint

__all__ = [
    "ABOVE",
    "ENDINGS",
    "FIRING",
    "GAP",
    "MARK",
    "MARK_OPACITY",
    "MAX_PLOT_LINES",
    "SILENT",
    "Annotations",
    "Arrow",
    "Camera",
    "Curve",
    "Drawing",
    "Film",
    "Ground",
    "Motion",
    "Outline",
    "Painter",
    "Plot",
    "PlotStrip",
    "Viewpoint",
    "annotate",
    "bounding_box",
    "camera_axes",
    "caption",
    "check_picture",
    "draw",
    "geom_colours",
    "gl_problem",
    "ground_height",
    "height_grid",
    "motion_of",
    "muscle_colour",
    "muscle_radius",
    "muscle_width",
    "natural_angles",
    "nice_step",
    "output_path",
    "rate_of",
    "read_activations",
    "read_motion",
    "resample",
    "still",
    "tendon_activation",
    "texture_of",
    "texture_pixels",
    "visible_geoms",
    "write_film",
    "write_frames",
    "write_gif",
    "write_mp4",
]
