"""The list of keys."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

KEYS = {
    "space": "play or pause",
    "N": "one step",
    "P": "push the body",
    "drag": "turn the camera; on the ground, look around",
    "right drag": "shift the camera",
    "wheel": "nearer, farther",
    "W A S D": "forwards, left, backwards, right",
    "Q E": "down, up",
    "← → ↑ ↓": "turn the camera",
    "O": "camera: orbit",
    "G": "camera: walk on the ground, at eye height",
    "F": "camera: follow the body",
    "1 2 …": "camera: the model's own",
    "Ctrl K": "search all commands",
    "?": "this list",
}


def add_help(client: Any, more: Mapping[str, str]) -> None:
    """Let a browser show the list of keys on `?`, and by a button in the container that is open.

    **Arguments:** `more`: keys of other parts of the page, and what they do; they stand last.
    """
    rows = "\n".join(f"| `{key}` | {said} |" for key, said in {**KEYS, **more}.items())

    def show(_: Any) -> None:
        with client.gui.add_modal("Keys and mouse") as modal:
            client.gui.add_markdown(f"| key | what it does |\n|---|---|\n{rows}")
            client.gui.add_button("Close").on_click(lambda _: modal.close())

    # viser's type lists no "?", its browser side knows it: the character typed, which takes shift on most keyboards
    hotkey: Any = "?"
    client.gui.add_command("Keys", hotkey=hotkey, modifier="shift", icon="keyboard").on_trigger(show)
    client.gui.add_button("Keys (?)", icon="keyboard").on_click(show)
