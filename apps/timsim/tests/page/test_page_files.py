"""Save and Load from a stranger's hand, through the page's own messages: nothing outside the folders is touched."""

import numpy as np
import pytest
from page_clients import client, fields, hear, update

from patience import until
from timsim import live


@pytest.fixture
def folders(page, tmp_path, monkeypatch):
    """The working folder and the run's, and one that is neither, with a policy in it."""
    found = [tmp_path / name for name in ("work", "run", "other")]
    for folder in found:
        folder.mkdir()
    (found[0] / "out").symlink_to(found[2])
    (found[0] / "far.npz").symlink_to(found[2] / "far.npz")
    page.session.order(live.Save(str(found[2] / "there.npz")))
    assert until(lambda: str(found[2]) in page.session.log[-1].text if page.session.log else False)
    assert until(lambda: not page.session._events)  # the page has told those who were there
    monkeypatch.setattr(page.session, "folders", found[:2])
    return found


def told(page, *, pressed, path):
    """The notifications that a browser gets which presses a button for this path."""
    panel = page.panels.panels["Learning"]
    (buttons,) = (field for field in fields(page) if _has(field, pressed))
    with client(page) as connection:
        update(connection, panel._path, path)
        assert until(lambda: panel._path.value == path)
        update(connection, buttons, pressed)
        said = []
        while not said:
            shown = [each["props"] for each in hear(connection) if each["type"] == "NotificationShowMessage"]
            said = [(props["title"], props["body"]) for props in shown]
    return said


def _has(field, option):
    return option in (getattr(field._impl.props, "options", None) or ())


def files_of(folder):
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())


@pytest.mark.ci
def test_what_lies_inside_is_saved_and_loaded(page, folders):
    work, run, _ = folders
    for path, file in (("a.npz", work / "a.npz"), ("sub/b.npz", work / "sub/b.npz"), (f"{run}/c.npz", run / "c.npz")):
        assert told(page, pressed="Save", path=path) == [("Saved", f"policy saved to {file}")]
        assert told(page, pressed="Load", path=path) == [("Loaded", f"policy loaded from {file}")]


def test_nothing_outside_is_written_or_read(page, folders):
    before = page.session.snapshot().parameters
    paths = [
        "../x.npz",
        "sub/../../other/x.npz",
        "out/x.npz",
        "far.npz",
        "/tmp/motorgrad-x.npz",
        "~/../x.npz",
        "/x.npz",
    ]
    paths += [str(folders[2] / "x.npz"), "out/there.npz", str(folders[2] / "there.npz"), "../other/there.npz", ""]
    content = (folders[2] / "there.npz").read_bytes()
    for path in paths:
        for button in ("Save", "Load"):
            ((title, text),) = told(page, pressed=button, path=path)
            assert title == "Refused"
            assert "must be within" in text
            assert str(folders[0]) in text
    assert files_of(folders[0].parent) == ["other/there.npz"]
    assert (folders[2] / "there.npz").read_bytes() == content
    np.testing.assert_array_equal(page.session.snapshot().parameters, before)


def test_no_other_file_is_overwritten(page, folders):
    for name, content in (("data.npz", b"precious"), ("empty.npz", b"")):
        (folders[0] / name).write_bytes(content)
        ((title, text),) = told(page, pressed="Save", path=name)
        assert (title, "must be new, or a saved policy" in text) == ("Refused", True)
        assert (folders[0] / name).read_bytes() == content


@pytest.mark.parametrize("content", [b"", b"no", b"PK\x03\x04" + bytes(100)])
def test_a_damaged_file_is_told_and_the_run_lives(page, folders, content):
    (folders[0] / "bad.npz").write_bytes(content)
    ((title, text),) = told(page, pressed="Load", path="bad.npz")
    assert title == "Refused"
    assert "bad.npz: not a saved policy" in text
    decision = page.session.snapshot().decision
    page.session.order(live.Step(3))
    assert until(lambda: page.session.snapshot().decision == decision + 3)
    assert not page.session.ended
