"""Agents from a table of settings, as configuration files have them."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from motorgrad._settings import build

if TYPE_CHECKING:
    from motorgrad.learning import Agent


class _Sized:
    """What the settings of an agent ask of a task: its sizes."""

    name = "diagram"
    observation_range = None
    mirror = None

    def __init__(self, observed: int, actions: int):
        self.observation_size, self.action_size = observed, actions


def agent_of(settings: Mapping[str, Any], observed: int, actions: int) -> "Agent":
    """The agent of these settings (`motorgrad.training.AgentSettings`). **Raises** `ValueError` for what is unknown or
    impossible."""
    from motorgrad.training import AgentSettings  # which takes a while to load

    return build(AgentSettings, settings, "settings").agent(_Sized(observed, actions))  # type: ignore[arg-type]
