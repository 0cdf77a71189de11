"""Pages that are exported have the licences of the packages that are built into them."""

import importlib.metadata
import json
import re
from pathlib import Path

import pytest

import timlab
import timsim
from timlab.editor._static import STATIC

PACKAGE = re.compile(r"^(\S+) (\d\S*): \S", re.MULTILINE)
TERMS = re.compile(r"permission|redistribution|license", re.IGNORECASE)
TEXTLESS = "It comes without the text of its licence."
"""Of a package whose authors have forgotten it. The licence's name is there."""


def told(text):
    """The packages whose licences are in a text, with their versions; and those whose text is there, too."""
    packages, whole = set(), set()
    for group in re.split(r"^-{80}$", text, flags=re.MULTILINE):
        own = set(PACKAGE.findall(group))
        assert own
        packages |= own
        if TEXTLESS not in group:
            assert TERMS.search(group)
            whole |= own
    return packages, whole


def locked(lock):
    """The packages, but for tools and types, that a lock file of npm names, with their versions."""
    entries = json.loads(Path(lock).read_text(encoding="utf-8"))["packages"].items()
    found = ((path.rsplit("node_modules/", 1)[-1], entry) for path, entry in entries if path)
    built = ((name, entry) for name, entry in found if not (entry.get("dev") or entry.get("devOptional")))
    return {(name, entry["version"]) for name, entry in built if not name.startswith("@types/")}


@pytest.mark.parametrize("name", ["viewer.js", "widget.js"])
def test_what_is_built_for_pages_of_timlab_begins_with_them(name):
    if not STATIC.is_dir():
        pytest.skip("the editor's pages are not built: make editor")
    packages, whole = told((STATIC / name).read_text(encoding="utf-8").split("*/", 1)[0])
    wanted = locked(STATIC.parent / "frontend" / "package-lock.json")
    assert len(wanted) > 15
    assert wanted <= packages == whole


def test_a_page_of_a_diagram_has_them():
    if not STATIC.is_dir():
        pytest.skip("the editor's pages are not built: make editor")
    diagram = timlab.Diagram()
    diagram.add("one", timlab.Constant(1.0))
    page = timlab.to_html(diagram, timlab.Run(diagram).advance(1))
    assert all(f"\n{name} {version}: " in page for name, version in told((STATIC / "viewer.js").read_text("utf-8"))[0])


def test_a_recorded_scene_has_those_of_visers_client():
    import viser

    from timsim.panels._capture import LICENCES, SceneRecording

    text = LICENCES.read_text(encoding="utf-8")
    packages, whole = told(text)
    assert ("viser", importlib.metadata.version("viser")) in whole, "run python -m tools.viser_licences"
    client = Path(viser.__file__).parent / "client"
    assert len(packages) > 100
    assert packages - {("viser", importlib.metadata.version("viser"))} <= locked(client / "package-lock.json")
    assert {"react", "three", "@mantine/core", "uplot", "@tabler/icons-react"} <= {name for name, _ in whole}
    server = viser.ViserServer("127.0.0.1", 0, verbose=False)
    try:
        page = SceneRecording(server).html().decode()
    finally:
        server.stop()
    assert page.startswith("<!doctype html>\n<!-- ")
    assert text in page[: page.index("-->")]
    assert page.count("<!doctype html>") == 1


def test_replays_have_nothing_of_others_in_them():
    replay = Path(timsim.__file__).parent / "replay"
    own = [path for path in replay.iterdir() if path.suffix in (".js", ".css", ".html")]
    assert own
    for path in own:
        assert not re.search(
            r"@license|copyright|node_modules|\bimport\b.*from", path.read_text("utf-8"), re.IGNORECASE
        )
