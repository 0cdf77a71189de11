"""Browsers that may only watch: what they may send."""

from __future__ import annotations

import viser
from viser import _messages as viser_messages

from timsim.scene import own_elements

SHARE = 0.9  # of all places, which watching browsers may take; the others are kept for those who drive


RATE = 50.0  # messages per second of a watching browser; while its camera is turned, it sends about 20


def may_watch(client: viser.ClientHandle | None, message: object) -> bool:
    """Whether a watching browser may send this: where its camera is, and values of elements that are its own alone.

    `client` is viser's handle of it, which it has from its first message on.
    """
    if isinstance(message, viser_messages.ViewerCameraMessage):
        return True
    if not isinstance(message, viser_messages.GuiUpdateMessage | viser_messages.CommandTriggerMessage):
        return False
    return client is not None and message.uuid in own_elements(client)
