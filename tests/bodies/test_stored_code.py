"""Machine code of muscles that an earlier process compiled."""

import json
import subprocess
import sys

import pytest

from motorgrad import _program_store
from motorgrad.bodies.muscles import _machine_code, _stored_code

INSTALLED = """
import json, sys
from motorgrad.bodies import install_muscle_callback
from motorgrad.bodies.muscles._machine_code import machine_code
install_muscle_callback()  # which compares forces and states with the formulas
print(json.dumps([machine_code(f"mjcb_act_{name}").owner.cache_hits for name in ("gain", "dyn", "bias")]))
"""


@pytest.fixture
def hits(tmp_path, monkeypatch):
    """How often the gain was read from a new cache, of one more time that it is made."""
    import numba

    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    return lambda: _machine_code.machine_code.__wrapped__("mjcb_act_gain").owner.cache_hits


def test_code_is_read_as_long_as_its_source_is_the_same(hits, monkeypatch):
    assert [hits(), hits()] == [0, 1]
    monkeypatch.setattr(_stored_code, "_source", lambda: "another")
    assert [hits(), hits()] == [0, 1]


def test_nothing_is_kept_where_the_user_has_turned_it_off(hits, monkeypatch, tmp_path):
    monkeypatch.setenv(_program_store.VARIABLE, "off")
    assert [hits(), hits()] == [0, 0]
    assert not [*tmp_path.iterdir()]


def test_code_is_compiled_where_no_folder_can_be_written(hits, monkeypatch):
    from numba.core.caching import CompileResultCacheImpl

    monkeypatch.setattr(CompileResultCacheImpl, "_locator_classes", [])
    assert [hits(), hits()] == [0, 0]


@pytest.mark.ci
def test_another_process_compiles_nothing(tmp_path, process_environment):
    environment = process_environment | {"NUMBA_CACHE_DIR": str(tmp_path)}
    found = []
    for _ in range(2):
        done = subprocess.run([sys.executable, "-c", INSTALLED], capture_output=True, text=True, env=environment)
        assert done.returncode == 0, done.stderr
        found.append(json.loads(done.stdout))
    assert found == [[0, 0, 0], [1, 1, 1]]
