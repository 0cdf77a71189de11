"""Linear systems about a point, against those that are known."""

import numpy as np
import pytest
from scipy.linalg import expm

import timlab as lab
from timlab import Diagram, Run, linearise


def oscillator() -> Diagram:
    """A mass on a damped spring, of two integrators: x'' = −4 x − 0.5 x' + u."""
    diagram = Diagram(tick=0.01)
    diagram.add("force", lab.Inlet(0.0))
    diagram.add("stiffness", lab.Gain(4.0))
    diagram.add("damping", lab.Gain(0.5))
    diagram.add("sum", lab.Sum("+--"))
    diagram.add("velocity", lab.Integrator())
    diagram.add("place", lab.Integrator(1.0))
    for source, target in (("force", "sum.u1"), ("stiffness", "sum.u2"), ("damping", "sum.u3"), ("sum", "velocity")):
        diagram.connect(source, target)
    for source, target in (("velocity", "place"), ("velocity", "damping"), ("place", "stiffness")):
        diagram.connect(source, target)
    return diagram


A, B = np.array([[-0.5, -4.0], [1.0, 0.0]]), np.array([[1.0], [0.0]])


def test_the_matrices_of_an_oscillator():
    found = linearise(Run(oscillator()), ["force.value"], ["place.y", "sum.y"])
    assert found.states == ["velocity", "place"]
    assert (found.inputs, found.outputs, found.tick) == (["force.value"], ["place.y", "sum.y"], 0.0)
    np.testing.assert_allclose(found.A, A, atol=1e-6)
    np.testing.assert_allclose(found.B, B, atol=1e-6)
    np.testing.assert_allclose(found.C, [[0, 1], [-0.5, -4]], atol=1e-6)
    np.testing.assert_allclose(found.D, [[0], [1]], atol=1e-6)
    np.testing.assert_allclose(found.state, [0, 1])
    np.testing.assert_allclose(found.output, [1, -4], atol=1e-6)


def test_a_whole_tick_is_the_exponential_of_the_matrix():
    found = linearise(Run(oscillator()), ["force.value"], ["place.y"], discrete=True)
    whole = expm(np.block([[A, B], [np.zeros((1, 3))]]) * 0.01)
    np.testing.assert_allclose(found.A, whole[:2, :2], atol=1e-6)
    np.testing.assert_allclose(found.B, whole[:2, 2:], atol=1e-6)
    assert found.tick == 0.01


def test_it_is_about_the_point_where_the_run_stands_and_leaves_it_there():
    diagram = Diagram(tick=0.1)
    diagram.add("x", lab.Integrator(0.3))
    diagram.add("rate", lab.Expression("-x^2 + k * x", ("x", "k")))
    diagram.add("k", lab.Inlet(0.5))
    for source, target in (("x", "rate.x"), ("k", "rate.k"), ("rate", "x")):
        diagram.connect(source, target)
    run = Run(diagram, seeds=2)
    run.advance(7)
    run["k.value"] = 0.7
    before = run.state
    found = linearise(run, ["k.value"], ["x.y"], seed=1)
    x = float(found.state[0])
    assert x == pytest.approx(float(found.output[0]))
    np.testing.assert_allclose(found.A, [[-2 * x + 0.7]], rtol=1e-5)
    np.testing.assert_allclose(found.B, [[x]], rtol=1e-5)
    np.testing.assert_array_equal(run.state["blocks"]["x"]["state"], before["blocks"]["x"]["state"])


def test_discrete_states_count_in_a_whole_tick_only():
    diagram = Diagram()
    diagram.add("memory", lab.UnitDelay())
    diagram.add("decay", lab.Gain(0.9))
    diagram.connect("memory", "decay")
    diagram.connect("decay", "memory")
    assert linearise(Run(diagram), outputs=["decay.y"]).A.shape == (0, 0)
    found = linearise(Run(diagram), outputs=["decay.y"], discrete=True)
    np.testing.assert_allclose(found.A, [[0.9]], rtol=1e-6)
    np.testing.assert_allclose(found.C, [[0.9]], rtol=1e-6)


@pytest.mark.parametrize(
    ("inputs", "outputs", "seed", "said"),
    [
        (["farce.value"], [], 0, "unknown block 'farce': did you mean 'force'"),
        (["force.valve"], [], 0, "did you mean 'value'"),
        ([], ["place.z"], 0, "unknown output 'place.z'"),
        ([], [], 3, "seed = 3: must be a row of the run, 0 … 0"),
    ],
)
def test_what_there_is_not_is_refused_by_name(inputs, outputs, seed, said):
    with pytest.raises(ValueError, match=said):
        linearise(Run(oscillator()), inputs, outputs, seed=seed)
