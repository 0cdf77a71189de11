"""A run in a process of its own: sessions, snapshots, orders."""

from motorgrad.sim.live._given import is_path, setup_of
from motorgrad.sim.live._orders import (
    Compare,
    Control,
    Edit,
    Freeze,
    Load,
    Order,
    Pause,
    Play,
    Push,
    Reset,
    Save,
    Scrub,
    Speed,
    Step,
    Thaw,
)
from motorgrad.sim.live._session import Event, Session
from motorgrad.sim.live._setup import BODIES, Setup, acting, bare, learner
from motorgrad.sim.live._snapshot import Curve, Snapshot, Trail
from motorgrad.sim.live._stage import Camera, Stage

__all__ = [
    "BODIES",
    "Camera",
    "Compare",
    "Control",
    "Curve",
    "Edit",
    "Event",
    "Freeze",
    "Load",
    "Order",
    "Pause",
    "Play",
    "Push",
    "Reset",
    "Save",
    "Scrub",
    "Session",
    "Setup",
    "Snapshot",
    "Speed",
    "Stage",
    "Step",
    "Thaw",
    "Trail",
    "acting",
    "bare",
    "is_path",
    "learner",
    "setup_of",
]
