"""A run in a process of its own: sessions, snapshots, orders."""

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
from motorgrad.sim.live._setup import Setup, learner
from motorgrad.sim.live._snapshot import Curve, Snapshot, Trail

__all__ = [
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
    "Step",
    "Thaw",
    "Trail",
    "learner",
]
