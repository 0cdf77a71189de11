"""The page in the browser: a session with its scene and its panels."""

from motorgrad.sim.page._address import HERE, ExposedWarning, check_port, warn_of
from motorgrad.sim.page._page import Page
from motorgrad.sim.page._show import show

__all__ = ["HERE", "ExposedWarning", "Page", "check_port", "show", "warn_of"]
