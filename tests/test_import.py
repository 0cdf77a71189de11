"""What is loaded when: the package and its help are light; heavy libraries come with their first use."""

import subprocess
import sys

import pytest

HEAVY = ("jax", "mujoco", "matplotlib", "pyarrow", "numba", "equinox", "optax", "rich", "numpy", "onnx", "fmpy")
# What only some tasks and methods compute with, and training does not wait for.
RARE = ("scipy", "gymnasium", "numba", "matplotlib", "evosax", "tinygp")


def loaded(code, environment, names=HEAVY):
    """The libraries of these names that some code has loaded by its end."""
    tell = f"; import sys; print([name for name in {names} if name in sys.modules], file=sys.stderr)"
    done = subprocess.run([sys.executable, "-c", code + tell], capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stderr
    return done.stderr.strip().splitlines()[-1]


@pytest.mark.parametrize(
    "code",
    [
        "import motorgrad",
        "import motorgrad as mg; dir(mg); mg.__version__",
        "from motorgrad.cli import main; main(['--help'])",
        "from motorgrad.cli import main; main([])",
        "from motorgrad.cli import main; main(['--version'])",
        "from motorgrad.cli import main; assert main(['trian']) == 2; sys = __import__('sys'); sys.stderr.flush()",
    ],
)
def test_nothing_heavy_is_loaded(code, process_environment):
    assert loaded(code, process_environment) == "[]"


def test_training_loads_no_library_that_only_some_tasks_and_methods_need(process_environment):
    assert loaded("import motorgrad.options", process_environment, RARE) == "[]"


def test_records_are_kept_and_read_without_pandas(compiled_environment):
    train = "import motorgrad as mg; mg.train('three-state', steps=10, progress=False).curve()"
    assert loaded(train, compiled_environment, {"pandas"}) == "[]"


@pytest.mark.parametrize(
    ("use", "needed"),
    [("mg.statistics.mean_of", "numpy"), pytest.param("mg.make('hopper')", "mujoco", marks=pytest.mark.ci)],
)
def test_a_name_loads_what_it_needs_when_first_used(use, needed, process_environment):
    # or the test above could not fail
    assert f"'{needed}'" in loaded(f"import motorgrad as mg; {use}", process_environment)


def test_every_public_name_can_be_had():
    import motorgrad

    for name in motorgrad.__all__:
        assert getattr(motorgrad, name) is not None
    assert set(motorgrad.__all__) <= set(dir(motorgrad))


def test_an_unknown_name_is_an_attribute_error():
    import motorgrad

    with pytest.raises(AttributeError, match="module 'motorgrad' has no attribute 'trian'"):
        motorgrad.trian  # noqa: B018
