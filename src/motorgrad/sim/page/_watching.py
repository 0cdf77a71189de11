"""Browsers that may only watch: what they may send."""

from __future__ import annotations

from typing import Any

import viser
from viser import _messages as viser_messages

from motorgrad.sim.scene import own_elements

SHARE = 0.9  # of all places, which watching browsers may take; the others are kept for those who drive


def may_watch(server: viser.ViserServer | None, message: Any) -> bool:
    """Whether a watching browser may send this: where its camera is, and values of elements that are its own alone."""
    if isinstance(message, viser_messages.ViewerCameraMessage):
        return True
    if not isinstance(message, viser_messages.GuiUpdateMessage | viser_messages.CommandTriggerMessage):
        return False
    # viser looks an element up among those of the sending browser, so that another's is of no use
    clients = [] if server is None else server.get_clients().values()
    return any(message.uuid in own_elements(client) for client in clients)
