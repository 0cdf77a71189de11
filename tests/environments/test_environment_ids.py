"""The ids: known to Gymnasium after an import of this library, in whatever order, and at no cost."""

import importlib.metadata
import subprocess
import sys

import gymnasium
import pytest

import motorgrad
from motorgrad import _gymnasium_ids
from motorgrad._task_table import TASK_TABLE
from motorgrad.tasks import TASKS

KNOWN = "; import sys, gymnasium; assert 'motorgrad/Hopper-v0' in gymnasium.registry"
HEAVY = "; print([name for name in ('jax', 'mujoco', 'matplotlib') if name in sys.modules])"


def run(code, environment):
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code], capture_output=True, text=True, env=environment, timeout=600
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def test_the_table_has_the_names_of_the_classes():
    assert {name: TASKS[name].name for name in TASK_TABLE} == {name: name for name in TASK_TABLE}
    assert set(TASKS) == set(TASK_TABLE)


def test_every_task_has_an_id():
    ours = set(TASKS) - {"gymnasium"}  # which is a foreign environment already
    assert set(_gymnasium_ids.TASK_OF.values()) == ours
    for name, task in _gymnasium_ids.TASK_OF.items():
        assert name == f"motorgrad/{task.title().replace('-', '')}-v0"
        assert gymnasium.spec(name).kwargs == {"task": task}
        assert gymnasium.spec(name).max_episode_steps == _gymnasium_ids.MAX_EPISODE_STEPS


@pytest.mark.ci
@pytest.mark.representatives("import gymnasium, motorgrad", "import motorgrad")
@pytest.mark.parametrize("code", ["import gymnasium, motorgrad", "import motorgrad, gymnasium", "import motorgrad"])
def test_an_import_makes_them_known_without_loading_anything_heavy(code, process_environment):
    assert run(code + KNOWN + HEAVY, process_environment) == "[]"


def test_the_library_alone_does_not_load_gymnasium(process_environment):
    code = "import sys, motorgrad; print('gymnasium' in sys.modules, len(sys.meta_path))"
    loaded, finders = run(code, process_environment).split()
    assert loaded == "False"
    # the one that waits for Gymnasium goes when it came
    code = "import sys; n = len(sys.meta_path); import motorgrad, gymnasium; print(len(sys.meta_path) - n)"
    assert run(code, process_environment) == "0"
    assert int(finders) > 0


def test_looking_for_gymnasium_without_loading_it_loses_no_ids(process_environment):
    code = "import motorgrad, importlib.util; importlib.util.find_spec('gymnasium'); import gymnasium"
    assert run(code + KNOWN + HEAVY, process_environment) == "[]"


@pytest.mark.ci
def test_gymnasium_imports_us_where_the_id_says_so(process_environment):
    code = "import gymnasium; print(gymnasium.make('motorgrad:motorgrad/Chain-v0').observation_space.shape)"
    assert run(code, process_environment) == "(6,)"


def test_a_gymnasium_that_is_not_there_is_no_error_of_ours(process_environment):
    code = (
        "import sys, motorgrad\n"
        "sys.path.clear()\n"
        "try: import gymnasium\n"
        "except ModuleNotFoundError as error: print(error.name)"
    )
    assert run(code, process_environment) == "gymnasium"


def test_the_entry_point_registers():
    found = importlib.metadata.entry_points(group="gymnasium.envs", name="motorgrad")
    if not found:
        pytest.skip("the library is not installed, or was before it had an entry point")
    (point,) = found
    known = dict(gymnasium.registry)
    try:
        for name in _gymnasium_ids.TASK_OF:
            del gymnasium.registry[name]
        point.load()()
        assert gymnasium.registry == known
        point.load()()  # a second time without a warning
    finally:
        gymnasium.registry.update(known)


def test_the_room_is_on_the_front_door():
    assert motorgrad.environments.TaskEnv.__name__ == "TaskEnv"


def test_a_wrong_name_is_told_the_right_one():
    with pytest.raises(gymnasium.error.NameNotFound, match="Hopper"):
        gymnasium.make("motorgrad/Hoper-v0")
