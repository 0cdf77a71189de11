"""The branches of a run, in the tab "Run": go to one, run one beside the present one, fork, rename, delete."""

from __future__ import annotations

import html

import viser

from timsim.live import Alongside, Branch, Delete, Fork, Rename, Switch
from timsim.panels._panel import Panel

NONE = "(none)"
MAX_SHOWN_EDITS = 4  # of a branch


class BranchFolder:
    """A folder with the branches of a run.

    **Arguments:** `panel`: that it belongs to.
    """

    def __init__(self, panel: Panel) -> None:
        self._panel = panel
        self._seen: object = None

    def fill(self, gui: viser.GuiApi) -> None:
        """Add the elements."""
        panel = self._panel
        with gui.add_folder("Branches"):
            self._list = gui.add_html("")
            hint = "What followed a moment in the past is kept."
            self._which = gui.add_dropdown("Branch", tuple("A"), hint=hint)  # of texts, not of "A" alone
            go = gui.add_button_group(" ", ("Go to", "Beside", "Delete"), hint="Beside: both run in step.")
            go.on_click(panel.guarded(lambda event: self._press(event.target.value)))
            self._name = gui.add_text("Name", "", hint="For Rename and for Fork; may be left empty for Fork.")
            name = gui.add_button_group("  ", ("Fork here", "Rename"), hint="Fork: another branch from this moment.")
            name.on_click(panel.guarded(lambda event: self._press(event.target.value)))

    def show(self) -> None:
        """Update what is shown."""
        branches, period = self._panel.session.branches, self._panel.session.period
        if (
            seen := [branch._replace(end=branch.end // max(1, round(0.5 / period))) for branch in branches]
        ) == self._seen:
            return
        self._seen = seen
        self._list.content = branch_list(branches, period)
        names = tuple(branch.name for branch in branches)
        others = [branch.name for branch in branches if not branch.present]
        chosen = self._which.value
        if self._which.options != names:
            self._which.options = names
        wanted = chosen if chosen in others else (others or names)[-1]
        if self._which.value != wanted:
            self._which.value = wanted

    def _press(self, button: str) -> None:
        panel = self._panel
        chosen = self._which.value
        name = self._name.value.strip()
        if button == "Beside":
            running = any(branch.beside and branch.name == chosen for branch in panel.session.branches)
            panel.order(Alongside(None if running else chosen))
            return
        orders = {"Go to": lambda: Switch(chosen), "Delete": lambda: Delete(chosen)}
        orders |= {"Fork here": lambda: Fork(name or None), "Rename": lambda: Rename(chosen, name)}
        panel.order(orders[button]())
        if button in ("Fork here", "Rename"):
            self._name.value = ""


def branch_list(branches: tuple[Branch, ...], period: float) -> str:
    """The branches as HTML: name, where it forked, how far it goes, and its edits; a bar shows when."""
    longest = max(max(branch.end for branch in branches), 1)
    rows = []
    for branch in branches:
        left = 100 * branch.start / longest
        wide = 100 * max(branch.end - branch.start, 0) / longest
        colour = "#0b6bcb" if branch.present else "#d9730d" if branch.beside else "#8a94a0"
        state = " · present" if branch.present else " · beside" if branch.beside else ""
        parent = html.escape(branch.parent)
        origin = f"from {parent} at {branch.start * period:,.2f} s" if parent else "from the start"
        if not branch.parent and branch.name != branches[0].name:
            origin = "from the start"
        edits = [f"{tick * period:,.2f} s: {html.escape(text)}" for tick, text in branch.edits[-MAX_SHOWN_EDITS:]]
        more = len(branch.edits) - len(edits)
        lines = "".join(f"<div>{line}</div>" for line in ([f"… {more} before"] if more else []) + edits)
        ticks = "".join(
            f'<span style="position:absolute;left:{100 * tick / longest:.2f}%;top:-2px;width:2px;height:9px;'
            f'background:currentColor"></span>'
            for tick, _ in branch.edits[-60:]
        )
        rows.append(
            f'<div class="motorgrad-branch" style="margin:0 10px 7px;font-size:12px;line-height:1.35">'
            f'<div><b style="color:{colour}">{html.escape(branch.name)}</b>{state}'
            f'<span style="opacity:.7"> · {origin} · to {branch.end * period:,.1f} s</span></div>'
            f'<div style="position:relative;height:5px;margin:3px 0;border-radius:3px;background:#80808040">'
            f'<span style="position:absolute;left:{left:.2f}%;width:{wide:.2f}%;height:5px;border-radius:3px;'
            f'background:{colour}"></span>{ticks}</div>'
            f'<div style="font-size:11px;opacity:.8;overflow-wrap:anywhere">{lines}</div></div>'
        )
    return "".join(rows)
