"""The page of TimSim: a session shown in the browser, with its scene and its panels."""

from timsim.page._page import HERE, ExposedWarning, Page, check_port, warn_of

__all__ = ["HERE", "ExposedWarning", "Page", "check_port", "warn_of"]
