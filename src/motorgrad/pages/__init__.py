"""What pages in a browser share: who may reach them, how they are opened, and going back in what they show."""

from motorgrad.pages._browser import open_in_browser
from motorgrad.pages._gate import (
    BACKLOG,
    COOKIE,
    HEADERS,
    LOCAL,
    STRANGERS,
    Answer,
    Gate,
    Lobby,
    Pace,
    Passed,
    strangers,
)
from motorgrad.pages._playback import (
    MAX_PLAYBACK_BYTES,
    MAX_PLAYBACK_STATES,
    Change,
    Clock,
    History,
    Line,
    Playable,
    Playback,
    size_of,
)

__all__ = [
    "BACKLOG",
    "COOKIE",
    "HEADERS",
    "LOCAL",
    "MAX_PLAYBACK_BYTES",
    "MAX_PLAYBACK_STATES",
    "STRANGERS",
    "Answer",
    "Change",
    "Clock",
    "Gate",
    "History",
    "Line",
    "Lobby",
    "Pace",
    "Passed",
    "Playable",
    "Playback",
    "open_in_browser",
    "size_of",
    "strangers",
]
