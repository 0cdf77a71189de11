"""What this user wrote is recognised, and nobody else's."""

import os

import pytest

from motorgrad import _ownership
from motorgrad._ownership import is_signed, signature


@pytest.fixture
def home(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.delenv("XDG_DATA_HOME", raising=False)
    yield tmp_path
    _ownership._key.cache_clear()


def again():
    """As another process of the same user."""
    _ownership._key.cache_clear()


def test_a_signature_holds_for_the_same_bytes_and_the_same_user_alone(home, tmp_path, monkeypatch):
    mark = signature(b"mine")
    again()
    assert is_signed(b"mine", f"{mark}\n")
    assert not is_signed(b"yours", mark)
    for wrong in ("", "0" * 64, "é", mark[:-1]):
        assert not is_signed(b"mine", wrong)
    monkeypatch.setenv("HOME", str(tmp_path / "other"))
    assert not is_signed(b"mine", mark)


def test_the_key_is_private(home):
    signature(b"mine")
    (file,) = home.rglob("key")
    assert file.stat().st_mode & 0o777 == 0o600
    assert file.stat().st_size == _ownership.KEY_BYTES


@pytest.mark.parametrize("fault", ["readable", "short", "long", "link", "pipe", "folder"])
def test_a_key_that_others_may_know_is_not_used(fault, home):
    mark = signature(b"mine")
    (file,) = home.rglob("key")
    content = file.read_bytes()
    file.unlink()
    if fault == "readable":
        file.write_bytes(content)
        file.chmod(0o644)
    elif fault == "link":
        (home / "elsewhere").write_bytes(content)
        (home / "elsewhere").chmod(0o600)
        file.symlink_to(home / "elsewhere")
    elif fault == "pipe":
        os.mkfifo(file, 0o600)
    elif fault == "folder":
        file.mkdir()
    else:
        file.write_bytes(content[1:] if fault == "short" else content + b"0")
        file.chmod(0o600)
    again()
    assert not is_signed(b"mine", mark)
    assert is_signed(b"mine", signature(b"mine"))  # within this process


def test_without_a_home_it_holds_within_the_process(tmp_path, monkeypatch):
    (tmp_path / "file").touch()
    monkeypatch.setenv("HOME", str(tmp_path / "file"))
    monkeypatch.delenv("XDG_DATA_HOME", raising=False)
    again()
    assert is_signed(b"mine", signature(b"mine"))
    again()
