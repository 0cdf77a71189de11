"""An off-screen OpenGL context, and whether this computer can make one."""

from __future__ import annotations

import functools
import os
import platform
import subprocess
import sys
from typing import Any

PACKAGES = "libegl1 libopengl0 libgl1-mesa-dri"
ADVICE = f"On Debian or Ubuntu, `apt-get install {PACKAGES}` gives the rendered picture, also without a graphics card."

# Run in a process of its own: a broken driver may abort the process that tries it.
_PROBE = """
import mujoco
from motorgrad.sim._gl import make_context
context = make_context({backend!r}, 16, 16)
context.make_current()
resources = mujoco.MjrContext(mujoco.MjModel.from_xml_string("<mujoco/>"), 100)
resources.free()
context.free()
print("ready")
"""


def backend() -> str:
    """The kind of context used here: `MUJOCO_GL` where it names one, else EGL on Linux and the system's own elsewhere.

    Read at each call and not from MuJoCo's own choice, which is made once, when it is first imported, and would ask
    for a window where no variable is set.
    """
    asked = os.environ.get("MUJOCO_GL", "").lower().strip()
    if asked in ("disable", "disabled", "off", "false", "0"):
        return "off"
    if platform.system() == "Linux":
        return asked if asked in ("egl", "osmesa", "glfw") else "egl"
    return "system"


def make_context(kind: str, width: int, height: int) -> Any:
    """An OpenGL context of kind "egl", "osmesa", "glfw" or "system", with `make_current()` and `free()`."""
    if kind == "egl":
        from mujoco.egl import GLContext
    elif kind == "osmesa":
        from mujoco.osmesa import GLContext
    elif kind == "glfw":
        from mujoco.glfw import GLContext
    else:
        from mujoco.rendering.classic.gl_context import GLContext
    return GLContext(width, height)


def gl_problem() -> str:
    """Why no OpenGL picture can be made here, in one line; empty if it can. Tried once, in another process."""
    return _problem(backend())


@functools.cache
def _problem(kind: str) -> str:
    if kind == "off":
        return "OpenGL is switched off by MUJOCO_GL"
    if kind == "egl":
        import ctypes

        try:
            ctypes.CDLL("libEGL.so.1")
        except OSError:
            return "the library libEGL.so.1 is not installed"
    paths = os.pathsep.join(path for path in sys.path if path)
    try:
        probe = subprocess.run(
            [sys.executable, "-c", _PROBE.format(backend=kind)],
            env={**os.environ, "PYTHONPATH": paths},
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=120,
        )
    except (OSError, subprocess.SubprocessError) as error:
        return f"a trial picture with {kind} failed: {type(error).__name__}"
    if probe.returncode == 0 and "ready" in probe.stdout:
        return ""
    lines = probe.stderr.strip().splitlines()
    return f"a trial picture with {kind} failed: {lines[-1] if lines else f'exit status {probe.returncode}'}"
