"""The panels of TimSim's page: run, learning, body, joints, muscles, policy, gait and capture.

Each panel is a tab that adds its own elements and updates them. Panels do not know each other, see a run through its
`Session` alone, and appear only where they apply.
"""

from motorgrad.sim.panels._clicks import ClickSelect
from motorgrad.sim.panels._figures import Figures
from motorgrad.sim.panels._film_recorder import FilmRecorder, SlowFilmRecorder
from motorgrad.sim.panels._motion_recorder import LONGEST_RECORDING
from motorgrad.sim.panels._overlay import Overlay
from motorgrad.sim.panels._panel import Panel, notify
from motorgrad.sim.panels._panels import PANELS, Panels
from motorgrad.sim.panels._replay_recorder import ReplayRecorder
from motorgrad.sim.panels._run import DragPush
from motorgrad.sim.panels._tour import Tours
from motorgrad.sim.panels._tours import TourStep, read_tour

__all__ = [
    "LONGEST_RECORDING",
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
