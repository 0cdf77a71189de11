"""All tests can be collected without any extra of motorgrad, also where the extras are installed."""

import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import needed
import without_extras
from motorgrad._extras import install
from tools import try_light
from tools.install import PACKAGES, ROOT

ALONE = [sys.executable, str(ROOT / "tests" / "without_extras.py")]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def test_every_module_of_tests_is_collected_or_names_the_extra_that_it_needs(compiled_environment):
    options = ["--collect-only", "-q", "-rs", "-p", "no:cacheprovider"]
    done = subprocess.run(
        [*ALONE, "-m", "pytest", *options], cwd=ROOT, capture_output=True, text=True, env=compiled_environment
    )
    assert done.returncode == 0, done.stdout[-5000:] + done.stderr
    skipped = [line for line in done.stdout.splitlines() if line.startswith("SKIPPED")]
    extras = PROJECT["optional-dependencies"]
    for folder, extra in {"apps/timsim": "sim", "apps/timlab": "lab", "thesis": "thesis"}.items():  # none can be left
        own = [line for line in skipped if f" {folder}/tests" in line]
        assert any(f"[{extra}]" in line for line in own), folder
    for line in skipped:
        assert any(f"[{extra}]" in line for extra in extras), line
    collected = {line.partition("::")[0] for line in done.stdout.splitlines() if "::" in line}
    folders = [ROOT / folder / "tests" for folder in PACKAGES]
    modules = {path.relative_to(ROOT).as_posix() for folder in folders for path in folder.rglob("test_*.py")}
    told = {module for module in modules if any(f" {module}:" in line for line in skipped)}
    left = {Path(line.split()[2].partition(":")[0]) for line in skipped}
    missing = {module for module in modules - collected - told if not left & set(Path(module).parents)}
    assert not missing


def test_every_extra_is_known_to_the_tests():
    assert set(needed.PACKAGES) == set(PROJECT["optional-dependencies"]) - {"all", "dev"}


def test_what_an_extra_installs_is_hidden_and_what_the_library_needs_is_not(compiled_environment):
    hidden = without_extras.modules_of(without_extras.distributions_of_extras())
    assert {"diffrax", "viser", "timsim", "timlab", "motorgrad_thesis"} <= hidden
    assert not {"jax", "mujoco", "pytest", "numpy", "motorgrad"} & hidden
    code = "from motorgrad.cli import main; raise SystemExit(main(['sim']))"
    done = subprocess.run([*ALONE, "-c", code], cwd=ROOT, capture_output=True, text=True, env=compiled_environment)
    assert done.stderr.endswith(f"motorgrad sim: this command needs more than the library: {install('sim')}\n")


def test_a_test_that_needs_what_is_not_there_is_skipped_aloud(monkeypatch):
    monkeypatch.setitem(needed.PACKAGES, "onnx", ("no_such_package",))
    needed.lacking.cache_clear()
    assert needed.lacking("motorgrad[onnx]") == "needs motorgrad[onnx]: no_such_package cannot be imported"
    needed.lacking.cache_clear()


def test_an_import_that_fails_for_another_reason_is_not_the_fault_of_an_extra():
    with pytest.raises(ImportError) as failed:
        from math import no_such_function  # noqa: F401
    assert needed.lacked_by(failed.value) == ""
    assert needed.lacked_by(ModuleNotFoundError(name="no_such_module")) == ""


def test_each_extra_of_a_command_is_tried():
    # no command needs these, or one that needs another extra first
    apart = {"all", "dev", "docs", "peers", "fmi", "pandas"}
    assert set(try_light.NEEDS.values()) == set(PROJECT["optional-dependencies"]) - apart
