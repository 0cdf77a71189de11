"""The engine stands by itself: no web package is loaded with it."""

import subprocess
import sys

import pytest

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
