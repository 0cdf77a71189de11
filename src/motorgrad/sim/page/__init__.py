"""The page of TimSim: a session shown in the browser, with its scene and its panels."""

# ruff: noqa: E402
from motorgrad._extras import require as _require

_require("TimSim's page needs", "viser", "sim")  # before anything imports it

from motorgrad.sim.page._page import HERE, ExposedWarning, Page, check_port, warn_of

__all__ = ["HERE", "ExposedWarning", "Page", "check_port", "warn_of"]
