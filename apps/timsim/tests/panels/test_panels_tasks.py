"""Tasks that TimSim's page saves: they replace nothing but themselves."""

import tomllib

import pytest

from motorgrad._files import read_toml

SETTINGS = {"body": {"kind": "arm"}, "reward": None, "actions": "continuous"}


@pytest.mark.parametrize("content", [b"", b"[project]\n", b"# saved by TimSim, ", b"x = 1"])
def test_what_was_not_saved_by_the_page_is_not_replaced(content, tmp_path):
    pytest.importorskip("viser")
    from timsim.panels._learn import save_task

    file = tmp_path / "pyproject.toml"
    file.write_bytes(content)
    with pytest.raises(ValueError, match=r"Save as = 'pyproject.toml': must be new, .*: take another name"):
        save_task(file, SETTINGS)
    assert file.read_bytes() == content


def test_what_was_saved_by_the_page_is_replaced_as_long_as_nobody_has_changed_it(tmp_path):
    pytest.importorskip("viser")
    from timsim.panels._learn import save_task

    file = tmp_path / "task.toml"
    for actions in ("continuous", "binary"):
        save_task(file, {**SETTINGS, "actions": actions})
        assert read_toml(file) == tomllib.loads(file.read_text()) == {"body": {"kind": "arm"}, "actions": actions}
    changed = file.read_text() + "# my own words\n"
    file.write_text(changed)
    with pytest.raises(ValueError, match="take another name"):
        save_task(file, SETTINGS)
    assert file.read_text() == changed


def test_a_file_of_a_term_is_read_in_the_folders_of_the_page_alone(tmp_path):
    pytest.importorskip("viser")
    from timsim.panels._learn import confined_term

    folder = tmp_path / "work"
    folder.mkdir()
    (tmp_path / "secret.csv").write_text("0,1\nsecret,2\n")
    (folder / "out.csv").symlink_to(tmp_path / "secret.csv")
    term = {"kind": "follow", "parts": "hand"}
    assert confined_term(term, [folder]) == term
    assert confined_term({**term, "file": "way.csv"}, [folder])["file"] == str(folder / "way.csv")
    for file in (str(tmp_path / "secret.csv"), "../secret.csv", "out.csv", "/etc/passwd", ["way.csv", "other.csv"]):
        with pytest.raises(ValueError, match=r"path = .* must be within|must be one path, without a comma"):
            confined_term({**term, "file": file}, [folder])


@pytest.mark.parametrize("text", ["inf", "-inf", "nan", "1e999", "", "1; rm"])
def test_a_number_of_the_page_is_finite(text):
    pytest.importorskip("viser")
    from timsim.panels._learn import _number

    with pytest.raises(ValueError, match=r"Decisions = .*: must be a finite number"):
        _number("Decisions", text)
