"""What a test may need beyond what `make install` installs, and whether it is there.

A test says so with the mark `needs`, and is skipped, with one line that names what is missing:

    @pytest.mark.needs("motorgrad[onnx]")
    def test_the_runtime_computes_the_same(): ...

`-m needs` selects all such tests.
"""

import functools
import importlib.util
from pathlib import Path

CHROMIUM = Path("/usr/bin/chromium")
PACKAGES = {
    "docs": ("ipykernel", "ipywidgets", "mkdocs_jupyter", "mkdocstrings", "nbclient", "nbformat"),
    "fmi": ("fmpy",),
    "lab": ("anywidget", "control", "diffrax", "pandas", "starlette", "uvicorn"),
    "myosuite": ("myosuite",),
    "onnx": ("onnx", "onnxruntime"),
    "peers": ("pathsim", "stable_baselines3", "torch"),
    "ray": ("ray",),
    "search": ("evosax", "optuna", "tinygp"),
    "sim": ("msgspec", "trimesh", "viser", "websockets"),
    "slurm": ("submitit",),
    "tensorboard": ("tensorboard",),
    "video": ("imageio_ffmpeg",),
}
"""The modules that the extras of motorgrad install and that tests or the library import."""


def of_extra(extra: str) -> str:
    """Why an extra is missing; empty if it is installed."""
    missing = [package for package in PACKAGES[extra] if importlib.util.find_spec(package) is None]
    return f"{', '.join(missing)} cannot be imported" if missing else ""


def _browser() -> str:
    if importlib.util.find_spec("playwright") is None:
        return "playwright cannot be imported"
    return "" if CHROMIUM.exists() else f"there is no {CHROMIUM}"


def _opengl() -> str:
    from motorgrad.sim import gl_problem  # not before a test asks: it starts a process

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
