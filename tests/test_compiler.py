"""How loops are compiled: said before JAX compiles anything, beside what a user has said."""

import json
import math
import os
import re
import subprocess
import sys

import pytest

from motorgrad._compiler import compilations, compile_small_loops_whole, quick_options

TELL = "import os, json; print(json.dumps(os.environ.get('XLA_FLAGS', '')))"


def flags(code, environment, **changes):
    done = subprocess.run(
        [sys.executable, "-c", f"{code}; {TELL}"], capture_output=True, text=True, env={**environment, **changes}
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


def test_small_loops_are_one_function(process_environment):
    bare = {name: value for name, value in process_environment.items() if name != "XLA_FLAGS"}
    said = flags("import motorgrad", bare)
    # where this fails for a new jaxlib, see that the next test passes and add the version to `TRIED`
    assert "xla_cpu_small_while_loop_byte_threshold=" in said


@pytest.mark.ci  # all other tests compile with these flags, too
def test_xla_knows_what_it_is_told(process_environment):
    bare = {name: value for name, value in process_environment.items() if name != "XLA_FLAGS"}
    said = flags("import motorgrad", bare)
    # XLA ends the process for a flag that it does not know, once it compiles
    loop = "import motorgrad, jax; print(jax.jit(lambda n: jax.lax.fori_loop(0, n, lambda i, x: x + i, 0))(5))"
    assert flags(loop, bare) == said


def test_a_version_that_was_not_tried_gets_no_options(monkeypatch):
    monkeypatch.setattr("jaxlib.version.__version__", "99.1")
    monkeypatch.setenv("XLA_FLAGS", "--xla_cpu_max_isa=AVX2")
    compile_small_loops_whole()
    assert os.environ["XLA_FLAGS"] == "--xla_cpu_max_isa=AVX2"


@pytest.mark.parametrize("level", [1, 2])
def test_a_program_that_is_compiled_quickly_computes_the_same(level):
    import jax
    import numpy as np

    def weights(seed):
        drawn = jax.random.truncated_normal(jax.random.key(seed), -2, 2, (64, 48))
        return drawn / 7, jax.random.uniform(jax.random.key(seed + 1), (128, 9))

    options = quick_options(level)
    assert options is not None  # XLA knows them
    quick, whole = (
        jax.jit(weights, compiler_options=each)(5) for each in (options, {"xla_backend_optimization_level": 3})
    )
    assert all(map(np.array_equal, quick, whole))


def test_what_a_user_has_said_stays(process_environment):
    own = "--xla_backend_extra_options=some_option=1"
    assert flags("import motorgrad", process_environment, XLA_FLAGS=own) == own
    other = "--xla_cpu_max_isa=AVX2"
    assert flags("import motorgrad", process_environment, XLA_FLAGS=other).startswith(f"{other} --xla_backend")


def test_a_run_says_how_it_was_compiled(tmp_path):
    import motorgrad as mg

    mg.train("three-state", steps=10, out=tmp_path, progress=False)
    session = json.loads((tmp_path / "provenance.json").read_text())["sessions"][-1]
    assert session["compiler"]["XLA_FLAGS"] == os.environ["XLA_FLAGS"]


@pytest.mark.ci
def test_programs_have_no_large_numbers_in_them(tmp_path):
    # XLA computes with them while it compiles, and raises an alarm where that takes more than a second
    import jax

    import motorgrad as mg

    mg.training.clear_programs()
    jax.config.update("jax_dump_ir_to", str(tmp_path))
    try:
        task = mg.make("hopper")
        mg.train(task, mg.presets.natural_network(task, 1_000), steps=20, progress=False)
    finally:
        jax.config.update("jax_dump_ir_to", "")
    programs = [path.read_text() for path in tmp_path.glob("*.mlir")]
    written = re.findall(r"dense(?:<\[|<\"0x|_resource<)[^\n]*? : tensor<([\dx]+)x", "\n".join(programs))
    sizes = [math.prod(map(int, shape.split("x"))) for shape in written]
    assert 100 < max(sizes) < 100_000  # 128 of the network


def test_compilations_are_counted():
    import jax

    before = compilations()
    double = jax.jit(lambda x: 2 * x)
    double(1.0)
    assert compilations() > before
    once = compilations()
    double(2.0)
    assert compilations() == once
