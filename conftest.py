"""Shared by all tests: the compilation cache, and the cases that are left to `make test-all`."""

import gc
import os
import webbrowser
from collections import defaultdict
from pathlib import Path

import pytest

import compilations
import motorgrad  # noqa: F401 - sets XLA's flags, which must be set before any test module makes an array
import needed

# All workers of a run share one folder of compiled functions. What a worker finds half written by another it compiles
# for itself. A process that a test starts does so, too, unless it is given `compiled_environment`.
_WORKER = "PYTEST_XDIST_WORKER" in os.environ
_RUN = Path(os.environ[compilations.FOLDER]) if _WORKER else compilations.open_run()
# XLA's new emitters of fused operations take half as long again to compile as the old ones, and pay for large arrays
# only. The small loops over decisions use neither. LLVM's higher levels take a tenth of the time of all tests, and pay
# for many decisions of many seeds. XLA's own passes, where sums are reordered, are those that users have.
_QUICK = "--xla_cpu_use_fusion_emitters=false --xla_backend_optimization_level=1"
_FLAGS = os.environ.get("XLA_FLAGS", "") + ("" if _WORKER else f" {_QUICK}")
_COMPILER = compilations.environment(_RUN) | {"XLA_FLAGS": _FLAGS}
_BROWSERS = {"browser", "chromium"}  # fixtures
_FIXTURES_NEED = dict.fromkeys(_BROWSERS, "chromium") | {"silhouette": "OpenGL"}
_MOST_RESIDENT = 1_500_000_000  # bytes of a process, above which the programs of the files before are dropped
# Folders of which `make test-share` runs the slow tests, too: every unit and world, and all that is done to a page.
_SHARE = tuple(
    f"{Path(__file__).parent.as_posix()}/{room}/"
    for room in ("tests/policies", "tests/worlds", "apps/timlab/tests/editor", "apps/timsim/tests/panels")
)
os.environ["XDG_DATA_HOME"] = str(_RUN / "data")  # the key with which runs are signed
os.environ[compilations.VARIABLE] = str(_RUN / "programs")  # of processes that have no other cache
os.environ.update(_COMPILER)  # read by JAX when it is imported, so not in a fixture
# Tracing makes millions of small objects that live on, and Python would look through all of them again and again. Young
# ones are still looked through; the others when the programs are dropped that most of them belong to.
gc.set_threshold(400_000, 1_000_000, 1_000_000)


def pytest_configure(config: pytest.Config) -> None:
    config.pluginmanager.register(needed)  # hooks of a conftest.py are not asked where another one fails


def pytest_collection(session: pytest.Session) -> None:
    if _WORKER or not session.config.getoption("numprocesses", None):  # who gives tests to workers compiles nothing
        compilations.share_context()


@pytest.hookimpl(tryfirst=True)  # before pytest chooses by marks
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leaves to `make test-all`, as slow, all cases of a test but its `representatives`, all tests in a browser but the
    `journey` of each page, and tests marked `ci`.

    Tests marked `ci`, and the slow tests of some folders, belong to the share that `make test-share` runs. A test in a
    browser that fails is tried again: pages are drawn by software, and an answer may come late.
    """
    cases: dict[str, list[pytest.Function]] = defaultdict(list)
    for item in items:
        for fixture in _FIXTURES_NEED.keys() & item.fixturenames:
            item.add_marker(pytest.mark.needs(_FIXTURES_NEED[fixture]))
        if _BROWSERS.intersection(item.fixturenames):
            item.add_marker(pytest.mark.flaky(reruns=1))
            if not item.get_closest_marker("journey"):
                item.add_marker(pytest.mark.slow)
        if item.get_closest_marker("representatives") is not None:
            cases[item.nodeid.partition("[")[0]].append(item)
    some = any("[" in argument for argument in config.args)  # cases asked for by name are only some of a test's
    for test, several in cases.items():
        names = several[0].get_closest_marker("representatives").args
        unknown = set(names) - {item.callspec.id for item in several}
        if unknown and not some:
            raise pytest.UsageError(f"{test}: representatives {sorted(unknown)} are not among its cases")
        for item in several:
            if item.callspec.id not in names:
                item.add_marker(pytest.mark.slow)
    for item in items:
        if item.get_closest_marker("ci") and not item.get_closest_marker("representatives"):
            item.add_marker(pytest.mark.slow)
        if item.get_closest_marker("slow") and item.path.as_posix().startswith(_SHARE):
            item.add_marker(pytest.mark.ci)


def pytest_collection_finish() -> None:
    gc.collect()
    gc.freeze()  # modules and tests live as long as the process


def pytest_runtest_teardown(item: pytest.Item, nextitem: pytest.Item | None) -> None:
    if nextitem is not None and nextitem.path != item.path:  # tests of one file share programs
        compilations.drop_programs(_MOST_RESIDENT)


def pytest_unconfigure() -> None:
    if not _WORKER:
        compilations.close_run(_RUN)


@pytest.fixture(scope="session")
def process_environment() -> dict[str, str]:
    """The environment of a process that a test starts: a user's, on few threads and without this session's cache."""
    few = {"OMP_NUM_THREADS": "1", "MPLBACKEND": "agg", "PYTHONUNBUFFERED": "1"}
    return {name: value for name, value in os.environ.items() if name not in _COMPILER} | few


@pytest.fixture(scope="session")
def compiled_environment(process_environment: dict[str, str]) -> dict[str, str]:
    """The same with this session's cache, for a process that is asked for what it computes, and not how it starts."""
    return process_environment | _COMPILER


@pytest.fixture
def said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The file in which a browser that does nothing else notes its arguments; it is the user's."""
    noted, program = tmp_path / "said", tmp_path / "browser"
    program.write_text(f'#!/bin/sh\necho "$@" > {noted}\n')
    program.chmod(0o700)
    monkeypatch.setenv("BROWSER", f"{program} %s")
    monkeypatch.setattr(webbrowser, "_tryorder", None)
    monkeypatch.setattr(webbrowser, "_browsers", {})
    return noted
