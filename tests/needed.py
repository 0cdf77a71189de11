"""What a test may need beyond what `make install` installs, and whether it is there.

A test says so with the mark `needs`, and is skipped, with one line that names what is missing:

    @pytest.mark.needs("motorgrad[onnx]")
    def test_the_runtime_computes_the_same(): ...

`-m needs` selects all such tests. The tests of a module, or of a folder with a conftest.py, that cannot be imported for
want of an extra are skipped likewise. The root's conftest.py registers this file as a plugin of pytest.
"""

import functools
import importlib.util
from collections.abc import Generator
from pathlib import Path

import pytest

CHROMIUM = Path("/usr/bin/chromium")
PACKAGES = {
    "docs": ("ipykernel", "ipywidgets", "mkdocs_jupyter", "mkdocstrings", "nbclient", "nbformat"),
    "fmi": ("fmpy",),
    "lab": ("timlab", "anywidget", "control", "diffrax", "platformdirs", "starlette", "uvicorn", "websockets"),
    "myosuite": ("myosuite",),
    "onnx": ("onnx", "onnxruntime"),
    "pandas": ("pandas",),
    "peers": ("pathsim", "stable_baselines3", "torch"),
    "ray": ("ray",),
    "search": ("evosax", "optuna", "tinygp"),
    "sim": ("timsim", "msgspec", "trimesh", "viser", "websockets"),
    "slurm": ("submitit",),
    "tensorboard": ("tensorboard",),
    "thesis": ("motorgrad_thesis",),
    "video": ("imageio_ffmpeg",),
}
"""The modules that the extras of motorgrad install and that tests or the packages import."""


def of_extra(extra: str) -> str:
    """Why an extra is missing; empty if it is installed."""
    missing = [package for package in PACKAGES[extra] if importlib.util.find_spec(package) is None]
    return f"{', '.join(missing)} cannot be imported" if missing else ""


def _browser() -> str:
    if importlib.util.find_spec("playwright") is None:
        return "playwright cannot be imported"
    return "" if CHROMIUM.exists() else f"there is no {CHROMIUM}"


def _opengl() -> str:
    if importlib.util.find_spec("timsim") is None:
        return "timsim cannot be imported"
    from timsim import gl_problem  # not before a test asks: it starts a process

    return gl_problem()


@functools.cache
def lacking(name: str) -> str:
    """Why something that a test needs is missing, in one line that names it; empty if it is there.

    **Arguments:** `name`: `"chromium"`, `"OpenGL"`, or an extra such as `"motorgrad[onnx]"`.
    """
    if name == "chromium":
        why = _browser()
    elif name == "OpenGL":
        why = _opengl()
    else:
        why = of_extra(name.removeprefix("motorgrad[").removesuffix("]"))
    return f"needs {name}: {why}" if why else ""


def lacked_by(error: BaseException) -> str:
    """The extra that is missing where an import failed, in one line that names it; empty if none is to blame."""
    from motorgrad._extras import MissingExtra

    found: BaseException | None = error
    while found is not None:
        if isinstance(found, MissingExtra):
            return str(found)
        if isinstance(found, ModuleNotFoundError) and found.name is not None:
            top = found.name.partition(".")[0]
            extras = [extra for extra, packages in PACKAGES.items() if top in packages]
            if extras and of_extra(extras[0]):
                return f"needs motorgrad[{extras[0]}]: {top} cannot be imported"
        found = getattr(found, "cause", None) or found.__cause__ or found.__context__  # `cause` is of a conftest
    return ""


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(
    collector: pytest.Collector,
) -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    """Skips, with one line that names it, a module or a folder that cannot be imported without an extra."""
    report = yield
    call = getattr(report, "call", None)
    if report.failed and call is not None and (why := lacked_by(call.excinfo.value)):
        report.outcome = "skipped"
        report.longrepr = (str(collector.path), 0, f"Skipped: {why}")
        report.result = []
    return report


@pytest.hookimpl(tryfirst=True)  # before fixtures are made
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Skips, with one line that names it, a test that needs what is not there."""
    for mark in item.iter_markers("needs"):
        for name in mark.args:
            if why := lacking(name):
                pytest.skip(why)
