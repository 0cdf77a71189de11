"""Elements that belong to one browser and change only its own view, so that watchers may use them."""

from __future__ import annotations

import weakref
from typing import Any, TypeVar

import viser

_own: weakref.WeakKeyDictionary[viser.ClientHandle, set[str]] = weakref.WeakKeyDictionary()
"""viser's identifiers of these elements, by their browser."""
H = TypeVar("H")


def watches(server: viser.ViserServer, client_id: int) -> bool:
    """Whether a browser may only watch. Unknown browsers may only watch."""
    connection = server._websock_server._live_connections.get(client_id)  # type: ignore[arg-type]
    return getattr(connection, "watches", True)


def own(handle: H) -> H:
    """Mark an element that belongs to one browser and changes only what that browser sees. **Returns** it.

    Nothing else that a watching browser presses or sends is heard. **Raises** `TypeError` for an element of the server,
    which all browsers share.
    """
    element: Any = handle
    client = element._impl.gui_api._owner
    if not isinstance(client, viser.ClientHandle):
        raise TypeError("own: an element that all browsers share")
    _own[client] = {*own_elements(client), element._impl.uuid}  # without those that were removed
    return handle


def own_elements(client: viser.ClientHandle) -> dict[str, Any]:
    """The marked elements and commands that a browser has, by viser's identifiers."""
    gui = client.gui
    known = {**gui._gui_input_handle_from_uuid, **gui._command_handle_from_uuid}
    return {uuid: known[uuid] for uuid in sorted(_own.get(client, ())) if uuid in known}
