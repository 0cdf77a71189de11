"""Shared by all tests: what JAX has compiled once in a session of tests is not compiled again."""

import os
import shutil
import tempfile

import pytest

# Most of the time of small tests goes into compiling the same few functions anew for every learner. All workers share
# one folder, gone when the session is done: what one finds half written by another it compiles for itself. So do the
# processes that tests start (`process_environment`).
_FOLDER = "JAX_COMPILATION_CACHE_DIR"
_WORKER = "PYTEST_XDIST_WORKER" in os.environ
_CACHE = {
    _FOLDER: os.environ[_FOLDER] if _WORKER else tempfile.mkdtemp(prefix="motorgrad-tests-"),
    "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0",
    "JAX_PERSISTENT_CACHE_MIN_ENTRY_SIZE_BYTES": "-1",
}
os.environ.update(_CACHE)  # read by JAX when it is imported, so not in a fixture


def pytest_unconfigure() -> None:
    if not _WORKER:
        shutil.rmtree(_CACHE[_FOLDER], ignore_errors=True)


@pytest.fixture(scope="session")
def process_environment() -> dict[str, str]:
    """The environment of a process that a test starts: a user's, on few threads and without this session's cache."""
    few = {"OMP_NUM_THREADS": "1", "MPLBACKEND": "agg", "PYTHONUNBUFFERED": "1"}
    return {name: value for name, value in os.environ.items() if name not in _CACHE} | few
