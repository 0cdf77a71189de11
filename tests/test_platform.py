"""Where JAX computes: on the processor unless the user says otherwise; asked of processes, as it is said only once."""

import json
import subprocess
import sys

import pytest

from motorgrad import _platform

TELL = """
import json, os, jax
print(json.dumps([os.environ.get("JAX_PLATFORMS"), jax.config.jax_platforms, jax.default_backend()]))
"""


def said(environment, code):
    bare = {name: value for name, value in environment.items() if name not in _platform.ASK}
    done = subprocess.run([sys.executable, "-c", code + TELL], capture_output=True, text=True, env=bare)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.mark.parametrize(
    ("code", "expected"),
    [
        ("import motorgrad", ["cpu", "cpu", "cpu"]),
        pytest.param("import jax, motorgrad", [None, "cpu", "cpu"], marks=pytest.mark.ci),  # imported, but not begun
        pytest.param("import jax; jax.numpy.zeros(1); import motorgrad", [None, None, "cpu"], marks=pytest.mark.ci),
    ],
)
def test_jax_computes_on_the_processor_unless_asked(code, expected, process_environment):
    assert said(process_environment, code) == expected


def test_a_user_that_asks_for_a_gpu_is_not_overruled(process_environment):
    code = "import motorgrad, os, json, jax; print(json.dumps([os.environ['JAX_PLATFORMS'], jax.config.jax_platforms]))"
    environment = process_environment | {"JAX_PLATFORMS": "cuda,cpu"}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment)
    assert json.loads(done.stdout) == ["cuda,cpu", "cuda,cpu"], done.stderr


def test_an_accelerator_that_is_left_alone_is_named(monkeypatch):
    monkeypatch.setattr(_platform, "accelerators", lambda: ["cuda13"])
    monkeypatch.setattr(_platform, "_chosen", True)
    with pytest.warns(UserWarning, match="on the processor, though cuda13 is installed: .* JAX_PLATFORMS=cuda"):
        _platform.tell_the_platform.__wrapped__()
    monkeypatch.setattr(_platform, "_chosen", False)  # the user has said so
    _platform.tell_the_platform.__wrapped__()
