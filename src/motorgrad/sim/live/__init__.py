"""A run in a process of its own: sessions, snapshots, orders."""

import importlib
from typing import TYPE_CHECKING, Any

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

if TYPE_CHECKING:
    from motorgrad.sim.live._page import HERE, Page, check_port
    from motorgrad.sim.live._show import ExposedWarning, is_path, setup_of, show, warn_of

_LATER: dict[str, str] = {
    **dict.fromkeys(("HERE", "Page", "check_port"), "_page"),
    **dict.fromkeys(("ExposedWarning", "is_path", "setup_of", "show", "warn_of"), "_show"),
}


def __getattr__(name: str) -> Any:
    """What needs the scene and the panels, which need what is here."""
    if name in _LATER:
        return getattr(importlib.import_module(f"motorgrad.sim.live.{_LATER[name]}"), name)
    raise AttributeError(f"module 'motorgrad.sim.live' has no attribute {name!r}")


__all__ = [
    "BODIES",
    "HERE",
    "Camera",
    "Compare",
    "Control",
    "Curve",
    "Edit",
    "Event",
    "ExposedWarning",
    "Freeze",
    "Load",
    "Order",
    "Page",
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
    "check_port",
    "is_path",
    "learner",
    "setup_of",
    "show",
    "warn_of",
]
