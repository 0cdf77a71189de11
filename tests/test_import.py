"""Importing the package, and its help, load nothing heavy."""

import subprocess
import sys

import pytest

HEAVY = ("jax", "mujoco", "numba", "matplotlib", "pyarrow", "equinox", "numpy", "tyro")


@pytest.mark.parametrize(
    "code",
    ["import motorgrad", "import motorgrad.cli; motorgrad.cli.main(['--help'])", "import motorgrad; dir(motorgrad)"],
)
def test_it_loads_nothing_heavy(code):
    check = f"{code}\nimport sys\nsys.exit(', '.join(name for name in {HEAVY} if name in sys.modules) or 0)"
    done = subprocess.run([sys.executable, "-c", check], capture_output=True, text=True)
    assert done.returncode == 0, f"loaded: {done.stderr}"
