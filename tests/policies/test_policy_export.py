"""Exported policies: C, ONNX and NumPy compute what the library computes."""

import sys

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from policy_examples import EXAMPLES, call, from_initial, policy_of, started

import motorgrad as mg
from compiled_c import CompiledC, needs_compiler
from motorgrad.cli import main
from motorgrad.export import NUMPY_LACKS, Untranslatable, numpy_file, onnx_model, read, traced
from motorgrad.policies import (
    INITIAL,
    BoundedHyperplanes,
    FeatureMap,
    GradedHyperplanes,
    Hyperplanes,
    MultilayerPerceptron,
    hyperplanes,
)
from motorgrad.policies._export import functions, programs, whole

DENSITIES = [f"density {each}" for each in ("truncated", "clipped")]
NAMES = [*sorted({*EXAMPLES, *INITIAL} - {"mirrored"}), "mirrored", *DENSITIES]
FEW = pytest.mark.representatives(
    "controller",
    "density truncated",
    "recurrent",
)
SITUATIONS = 12


def example(name):
    rng = np.random.default_rng(5)
    if name.startswith("density"):
        bounds = {"low": -1.0, "high": 2.0, "density": name.split()[1]}
        return BoundedHyperplanes(rng.normal(size=(2, 3)), rng.normal(size=2), [-1.0, 0.5], **bounds)
    return policy_of(name, 5) if name in EXAMPLES else from_initial(name, rng)


def situations(policy):
    """Inputs of every function, with a leading axis of situations."""
    rng = np.random.default_rng(1)
    given = {name: like for _, inputs in functions(policy).values() for name, like in inputs.items()}
    draw = {"uniforms": rng.uniform}
    return {
        name: draw.get(name, rng.normal)(size=(SITUATIONS, *like.shape)).astype(like.dtype)
        for name, like in given.items()
    }


def answers(policy, inputs):
    """What the library computes: by function, output and situation."""

    @jax.jit
    @jax.vmap
    def all_of(given):
        return {
            name: function(**{each: given[each] for each in like})
            for name, (function, like) in functions(policy).items()
        }

    return jax.tree.map(np.asarray, all_of({**inputs, "": np.zeros(SITUATIONS)}))


def called(call, inputs, told):
    """What an exported policy computes, in the same form."""
    rows = [
        {name: call(name, {each: inputs[each][row] for each in like}) for name, (_, like) in told.items()}
        for row in range(SITUATIONS)
    ]
    return jax.tree.map(lambda *each: np.stack(each), *rows)


def worst_ulp(found, wanted):
    """The largest difference in units of the last place of single precision."""
    worst = 0.0
    for ours, theirs in zip(jax.tree.leaves(found), jax.tree.leaves(wanted), strict=True):
        if theirs.dtype.kind != "f":
            np.testing.assert_array_equal(ours, theirs)
            continue
        ours, theirs = ours.astype(np.float32), theirs.astype(np.float32)
        worst = max(worst, np.max(np.abs(ours - theirs) / np.spacing(np.abs(theirs)), initial=0, where=ours != theirs))
    return worst


def assert_near(found, wanted, places=1e-5):
    """Equal up to rounding: counts of ulp mean little after a cancellation, so errors are relative to an array."""
    for ours, theirs in zip(jax.tree.leaves(found), jax.tree.leaves(wanted), strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=places, atol=places * np.max(np.abs(theirs), initial=1e-3))


@needs_compiler
@pytest.mark.representatives("density truncated")  # special functions; single precision takes the others
@pytest.mark.parametrize("name", NAMES)
def test_c_is_the_library_to_one_ulp(name, tmp_path):
    # in double precision, where neither's rounding hides an error of the translation
    with jax.enable_x64(True):
        policy = example(name)
        inputs = situations(policy)
        compiled = CompiledC(programs(functions(policy)), tmp_path)
        found = called(compiled, inputs, functions(policy))
        assert worst_ulp(found, answers(policy, inputs)) <= 1


@needs_compiler
# a translation that is right is so in either precision
@pytest.mark.representatives("recurrent", "softmax-2")
@pytest.mark.parametrize("name", NAMES)
def test_c_and_numpy_are_the_library_in_single_precision(name, tmp_path):
    policy = example(name)
    inputs, told = situations(policy), functions(policy)
    wanted = answers(policy, inputs)
    assert_near(called(CompiledC(programs(functions(policy)), tmp_path), inputs, told), wanted)
    (tmp_path / "policy.npz").write_bytes(numpy_file(programs(functions(policy), NUMPY_LACKS)))
    reader = read(tmp_path / "policy.npz")
    assert_near(called(lambda each, given: reader[each](**given), inputs, told), wanted)


@pytest.mark.needs("motorgrad[onnx]")
@FEW
@pytest.mark.parametrize("name", NAMES)
def test_onnx_is_the_library_in_single_precision(name):
    import onnxruntime

    policy = example(name)
    inputs = situations(policy)
    runtime = onnxruntime.InferenceSession(onnx_model(whole(functions(policy))).SerializeToString())
    names = [output.name for output in runtime.get_outputs()]
    rows = [
        dict(zip(names, runtime.run(None, {n: x[row] for n, x in inputs.items()}), strict=True))
        for row in range(SITUATIONS)
    ]
    flat = {
        each if output in (each, "action") else f"{each}_{output}": value
        for each, outputs in answers(policy, inputs).items()
        for output, value in outputs.items()
    }
    assert_near({each: np.stack([row[each] for row in rows]) for each in flat}, flat)


def sigmoid(x):
    return 1 / (1 + np.exp(-x))


def test_a_closed_form(tmp_path):
    weights, bias = np.array([[1.0, -2.0], [0.5, 0.25]]), np.array([0.1, -0.3])
    reader = read(Hyperplanes(weights, bias).export(tmp_path / "policy.npz"))
    y = np.array([0.7, -0.2])
    np.testing.assert_allclose(reader["prob"](observation=y)["prob"], sigmoid(weights @ y + bias), rtol=1e-6)
    assert reader["mode"](observation=y)["action"].tolist() == [1, 0]
    assert reader["sample"](observation=y, uniforms=[0.9, 0.1])["action"].tolist() == [0, 1]
    with pytest.raises(TypeError, match="unknown inputs"):
        reader["mode"](observation=y, memory=y)


def test_deviations_are_exported_behind_features(tmp_path):
    pool = GradedHyperplanes(np.zeros((2, 6)), np.zeros(2), np.log([0.5, 1.5]), 0.05)
    policy = mg.policies.Featured(pool, FeatureMap(squares=True), observed=3)
    reader = read(policy.export(tmp_path / "policy.npz"))
    np.testing.assert_allclose(reader["deviation"]()["deviation"], [0.55, 1.55], rtol=1e-6)


@pytest.mark.ci
@pytest.mark.parametrize("shape", ["tanh", "fourier", "radial"])
def test_features_and_standardised_layers_belong_to_a_policy(shape, tmp_path):
    features = FeatureMap(squares=True, products=True, nonlinear=5, shape=shape)
    policy = started(hyperplanes(3, 2, features=features, network=MultilayerPerceptron(hidden=(4,), standardise=True)))
    for k in range(5):
        policy = call(policy, "adapted", np.float32([k, 3.0 * k, -1.0]))
    reader = read(policy.export(tmp_path / "policy.npz"))
    y = np.array([0.3, 1.0, -0.5], np.float32)
    np.testing.assert_allclose(reader["prob"](observation=y)["prob"], call(policy, "prob", y), rtol=1e-5)


@pytest.mark.ci
def test_a_loaded_run_acts_without_its_task(tmp_path, monkeypatch):
    mg.train("chain", steps=40, seeds=2, out=tmp_path / "run", progress=False)
    monkeypatch.setattr(mg.tasks, "TASKS", {})
    policy = mg.load(tmp_path / "run").policy(seed=1)
    observation = np.eye(policy.inputs)[2]
    reader = read(policy.export(tmp_path / "new" / "folder" / "policy.npz"))  # missing folders are made
    found = reader["mode"](observation=observation)["action"]
    assert found == policy.mode(observation) == policy.mode(observation.tolist())
    assert main(["export", str(tmp_path / "run"), str(tmp_path / "told.npz"), "--seed", "1"]) == 0
    assert (tmp_path / "told.npz").read_bytes() == (tmp_path / "new" / "folder" / "policy.npz").read_bytes()


def test_what_can_be_exported_is_offered(tmp_path):
    policy = BoundedHyperplanes([[1.0, -0.5]], [0.1], [-1.0], low=-1.0, high=2.0, density="beta")
    with pytest.raises(Untranslatable, match=r"incomplete_beta.*only=\('prob', 'mode', 'deviation'\)"):
        policy.export(tmp_path / "policy.npz")
    reader = read(policy.export(tmp_path / "policy.npz", only=["prob", "mode"]))
    y = np.array([0.4, 0.3], np.float32)
    np.testing.assert_allclose(reader["prob"](observation=y)["prob"], policy.prob(y), rtol=1e-5)
    with pytest.raises(ValueError, match="unknown function 'mod': did you mean 'mode'"):
        policy.export(tmp_path / "policy.c", only=["mod"])


def test_a_missing_package_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "onnx", None)  # an import of it fails
    with pytest.raises(RuntimeError, match=r"needs the package onnx: pip install 'motorgrad\[onnx\]'"):
        hyperplanes(2, 1).export(tmp_path / "policy.onnx")


def test_what_cannot_be_exported_is_named(tmp_path):
    class Sorted(Hyperplanes):
        def prob(self, observation):
            return jnp.sort(super().prob(observation))

    policy = Sorted(np.ones((2, 2)), np.zeros(2))
    with pytest.raises(Untranslatable, match=r"Sorted as .c: sort: an export does not know"):
        policy.export(tmp_path / "policy.c")
    with pytest.raises(ValueError, match=r"must be a name that ends in .c, .onnx or .npz"):
        policy.export(tmp_path / "policy.py")
    assert not list(tmp_path.iterdir())


def test_what_is_known_is_computed_in_its_own_precision():
    def function(x):
        with jax.enable_x64(True):
            known = jnp.float32(1) + jnp.zeros((), jnp.float64) + 1e-12  # more digits than single precision has
            return {"y": x.astype(jnp.float64) * known}

    program = traced(function, {"x": np.ones((), np.float32)})
    assert 1 + 1e-12 in [operation.attributes.get("value") for operation in program.operations]


@pytest.mark.parametrize("name", ["erf", "erfc", "expm1", "log1p"])
def test_special_functions_that_a_target_lacks(name, tmp_path):
    x = np.concatenate([[0.0, 1e-7, -1e-7, 0.5], np.linspace(-0.9, 9, 41)]).astype(np.float32)
    function = getattr(jax.lax, name)
    program = traced(lambda x: {"y": function(x)}, {"x": x}, lacks=[name])
    assert name not in [operation.kind for operation in program.operations]
    (tmp_path / "f.npz").write_bytes(numpy_file({"f": program}))
    np.testing.assert_allclose(
        read(tmp_path / "f.npz")["f"](x=x)["y"], function(x), rtol=2e-5, atol=2e-7 * (name == "erf")
    )
