"""The engine stands by itself: no web package is loaded with it, and no solver that a diagram does not use."""

import subprocess
import sys

import pytest

from motorgrad._program_store import VARIABLE

WEB = ("starlette", "uvicorn", "websockets", "viser", "anywidget", "tornado", "aiohttp")


@pytest.mark.ci
def test_the_engine_runs_without_any_web_package(process_environment):
    code = f"""
import sys
for name in {WEB}:
    sys.modules[name] = None  # an import of it fails
import timlab
diagram = timlab.Diagram()
diagram.add("one", timlab.Constant(2.0))
diagram.add("end", timlab.Outlet())
diagram.connect("one", "end")
print(timlab.Run(diagram).advance(2)["end.u"].tolist(), timlab.Interpreter(diagram).advance(1)["end.u"].tolist())
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=process_environment)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "[[2.0, 2.0]] [[2.0]]"


def test_the_first_tick_loads_no_solver_and_its_programs_are_kept(process_environment, tmp_path):
    code = """
import sys
from timlab import Run
from timlab.gallery import example
Run(example("chain")).advance(1)
print([name for name in ("diffrax", "optimistix", "lineax") if name in sys.modules])
"""
    kept = process_environment | {VARIABLE: str(tmp_path)}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=kept)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "[]"
    assert [*tmp_path.glob("*/jit__ticks-*")]
