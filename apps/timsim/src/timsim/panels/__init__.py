"""The panels of TimSim's page: run, learning, body, joints, muscles, policy, gait and capture.

Each panel is a tab that adds its own elements and updates them. Panels do not know each other, see a run through its
`Session` alone, and appear only where they apply.
"""

from timsim.panels._clicks import ClickSelect
from timsim.panels._figures import Figures
from timsim.panels._film_recorder import FilmRecorder, SlowFilmRecorder
from timsim.panels._motion_recorder import MAX_RECORDING_SECONDS
from timsim.panels._overlay import Overlay
from timsim.panels._panel import Panel, notify
from timsim.panels._panels import PANELS, Panels
from timsim.panels._replay_recorder import ReplayRecorder
from timsim.panels._run import DragPush
from timsim.panels._tour import Tours
from timsim.panels._tours import TourStep, read_tour

__all__ = [
    "MAX_RECORDING_SECONDS",
    "PANELS",
    "ClickSelect",
    "DragPush",
    "Figures",
    "FilmRecorder",
    "Overlay",
    "Panel",
    "Panels",
    "ReplayRecorder",
    "SlowFilmRecorder",
    "TourStep",
    "Tours",
    "notify",
    "read_tour",
]
