"""Shared by all tests: the compilation cache, and the cases that are left to `make test-all`."""

import os
from collections import defaultdict
from pathlib import Path

import pytest

import compilations

# All workers of a run share one folder of compiled functions. What a worker finds half written by another it compiles
# for itself. The processes that tests start compile for themselves, too (`process_environment`).
_WORKER = "PYTEST_XDIST_WORKER" in os.environ
_RUN = Path(os.environ[compilations.FOLDER]) if _WORKER else compilations.open_run()
_CACHE = compilations.environment(_RUN)
_BROWSERS = {"browser", "chromium"}  # fixtures
os.environ.update(_CACHE)  # read by JAX when it is imported, so not in a fixture


@pytest.hookimpl(tryfirst=True)  # before pytest chooses by marks
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Of a test that is `thinned`, every third case is quick, or those that the mark names; the others are slow. Where
    none that is named was collected, all are quick, so that a wrong name leaves out nothing.

    A test in a browser is tried twice: an answer may come late where pages are drawn by software, beside all else.
    """
    cases: dict[str, list[pytest.Item]] = defaultdict(list)
    for item in items:
        if _BROWSERS.intersection(item.fixturenames):
            item.add_marker(pytest.mark.flaky(reruns=1))
        if item.get_closest_marker("thinned") is not None and not item.get_closest_marker("slow"):
            cases[item.nodeid.partition("[")[0]].append(item)
    for several in cases.values():
        named = several[0].get_closest_marker("thinned").args
        quick = [item for item in several if item.callspec.id in named] or several[:: 1 if named else 3]
        for item in several:
            if item not in quick:
                item.add_marker(pytest.mark.slow)


def pytest_unconfigure() -> None:
    if not _WORKER:
        compilations.close_run(_RUN)


@pytest.fixture(scope="session")
def process_environment() -> dict[str, str]:
    """The environment of a process that a test starts: a user's, on few threads and without this session's cache."""
    few = {"OMP_NUM_THREADS": "1", "MPLBACKEND": "agg", "PYTHONUNBUFFERED": "1"}
    return {name: value for name, value in os.environ.items() if name not in _CACHE} | few
