"""Building TimLab's distribution: what is installed has the pages of the editor, or says why not."""

import os
from pathlib import Path

import pytest

from apps.timlab.tools import build_editor, hatch_build
from timlab.editor._static import NOT_BUILT

ROOT = Path(__file__).parents[3]


@pytest.fixture
def builder(monkeypatch, tmp_path):
    """`tools/build_editor.py`, whose pages and sources are in an empty folder."""
    sources, built = tmp_path / "frontend", tmp_path / "static" / "index.html"
    sources.mkdir()
    (sources / "index.html").write_text("source")
    icons = tmp_path / "icons.json"
    icons.write_text("{}")
    for name, value in {"SOURCES": sources, "BUILT": built, "ICONS": icons}.items():
        monkeypatch.setattr(build_editor, name, value)
    return build_editor


def test_pages_are_outdated_where_missing_or_older_than_a_source(builder):
    assert builder.outdated()
    builder.BUILT.parent.mkdir()
    builder.BUILT.write_text("built")
    for source, age in ((builder.ICONS, 10), (builder.SOURCES / "index.html", 10), (builder.BUILT, 10)):
        os.utime(source, (age, age))
    assert not builder.outdated()  # as in a source distribution, all of whose files are one age
    os.utime(builder.SOURCES / "index.html", (11, 11))
    assert builder.outdated()


def hook(builder, monkeypatch):
    monkeypatch.setattr(hatch_build, "build_editor", builder)
    told = []
    made = hatch_build.EditorPages.__new__(hatch_build.EditorPages)
    app = property(lambda _: type("App", (), {"display_warning": told.append}))
    monkeypatch.setattr(hatch_build.EditorPages, "app", app)
    return made, told


def test_a_build_without_pages_fails_and_an_installation_warns(builder, monkeypatch):
    made, told = hook(builder, monkeypatch)
    monkeypatch.setenv("PATH", "/nowhere")  # no Node
    monkeypatch.delenv("PIP_BUILD_TRACKER", raising=False)
    assert made.dependencies() == [builder.PACKAGED]
    with pytest.raises(RuntimeError, match=r"pages of TimLab's editor could not be built: .*Node\.js 20\.19 or later"):
        made.initialize("standard", {})
    monkeypatch.setenv("PIP_BUILD_TRACKER", "/tmp/tracker")
    made.initialize("standard", {})
    assert "Everything but `motorgrad lab` works" in told[0]
    made.initialize("editable", {})  # which has those of the checkout
    assert len(told) == 1


def test_the_message_about_missing_pages_names_the_checkout():
    assert f" in the checkout, {ROOT}, " in NOT_BUILT
    assert (ROOT / "apps/timlab/tools/build_editor.py").samefile(build_editor.__file__)
    assert "`python apps/timlab/tools/build_editor.py`" in NOT_BUILT
