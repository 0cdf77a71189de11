"""The panels of TimSim's page: the run, the learning, the muscles, the policy, the gait; and capture.

Every panel is a tab that adds its own elements and renews them; none knows another, and one that does not apply to a
run does not appear. They see a run through its `Session` alone.
"""

from motorgrad.sim.panels._film import FilmRecorder
from motorgrad.sim.panels._panel import Panel
from motorgrad.sim.panels._panels import PANELS, Panels
from motorgrad.sim.panels._push import DragPush

__all__ = ["PANELS", "DragPush", "FilmRecorder", "Panel", "Panels"]
