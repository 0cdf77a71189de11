"""Diagrams cut out, grouped, and given to others: as environments and as policies."""

import re

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import timlab as lab
from timlab import Diagram, DiagramEnv, DiagramPolicy, Run, extract, group


def cart() -> Diagram:
    """A place pushed by an action and by noise; paid for being near 0, over beyond 2."""
    diagram = Diagram(tick=0.1)
    diagram.add("action", lab.Inlet())
    diagram.add("noise", lab.NormalNoise())
    diagram.add("push", lab.Sum("++"))
    diagram.add("place", lab.Integrator())
    diagram.add("pay", lab.Expression("-place^2", ("place",)))
    diagram.add("gone", lab.Expression("place * place > 4", ("place",)))
    diagram.add("over", lab.Compare(">"))
    diagram.add("half", lab.Constant(0.5))
    for name in ("observation", "reward"):
        diagram.add(name, lab.Outlet())
    diagram.add("terminated", lab.Outlet(kind="bool"))
    wires = "action push.u1,noise push.u2,push place,place pay,place gone,gone over.u1,half over.u2,place observation"
    for wire in f"{wires},pay reward,over terminated".split(","):
        diagram.connect(*wire.split())
    return diagram


@pytest.mark.ci
@pytest.mark.filterwarnings("ignore:.*A Box observation space m")  # a diagram says nothing of bounds
def test_it_passes_the_checker():
    check_env(DiagramEnv(cart(), limit=50), skip_render_check=True)


def test_an_observation_is_of_the_state_that_the_action_led_to():
    environment = DiagramEnv(cart(), decision=3, low=-5, high=5)
    first, _ = environment.reset(seed=3)
    after, paid, *_, info = environment.step(np.array([2.0], np.float32))
    seed = int(np.random.Generator(np.random.PCG64(3)).integers(2**31))
    diagram = cart()
    diagram.replace("action", lab.Inlet(2.0))
    alone = Run(diagram, [seed]).advance(4)
    np.testing.assert_allclose(first, alone["observation.u"][0, :1], atol=1e-6)
    np.testing.assert_allclose(after, alone["observation.u"][0, 3:], rtol=1e-5)
    assert paid == pytest.approx(alone["reward.u"][0, 1:].sum(), rel=1e-5)
    assert info["time"] == pytest.approx(0.3)


def test_it_ends_where_its_outlet_says_so_and_is_cut_at_the_limit():
    environment = DiagramEnv(cart(), terminated="terminated", low=-30, high=30, limit=4)
    environment.reset(seed=0)
    assert environment.step([30.0])[2:4] == (True, False)
    with pytest.raises(gymnasium.error.ResetNeeded):
        environment.step([0.0])
    environment.reset(seed=0)
    assert [environment.step([0.0])[3] for _ in range(4)] == [False, False, False, True]


def test_seeds_make_episodes_and_nothing_is_compiled_again():
    environment = DiagramEnv(cart())
    ends = []
    for seed in (1, None, 1):
        environment.reset(seed=seed)
        ends.append(environment.step([0.0])[0].item())
    assert ends[0] == ends[2] != ends[1]
    assert environment._diagram.run.compilations == 1


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"action": "actoin"}, "unknown inlet 'actoin': did you mean 'action'"),
        ({"reward": "place"}, "unknown outlet 'place'"),
        ({"decision": 0}, "decision = 0"),
        ({"low": 1.0}, "low, high"),
        ({"limit": 0}, "limit = 0"),
    ],
)
def test_impossible_environments_are_refused_by_name(settings, said):
    with pytest.raises(ValueError, match=said):
        DiagramEnv(cart(), **settings)


@pytest.mark.parametrize(
    ("action", "said"),
    [
        ([3.0], "action = [3.0]: must be numbers from -1 to 1"),
        ([np.nan], "action = [nan]: must be numbers from -1 to 1"),
        ([-np.inf], "action = [-inf]: must be numbers from -1 to 1"),
        (0.5, "action.shape = (): must be (1,)"),
        ([0.1, 0.2], "action.shape = (2,): must be (1,)"),
        ([[0.1], [0.2, 0.3]], "action = [[0.1], [0.2, 0.3]]: must be numbers"),
        (["left"], "action.dtype"),
        ([1j], "action.dtype"),
        (None, "action.shape = ()"),
    ],
)
def test_a_foreign_action_is_refused(action, said, environment):
    with pytest.raises(ValueError, match=re.escape(said)):
        environment.step(action)


@pytest.fixture(scope="module")
def environment():
    made = DiagramEnv(cart())
    made.reset(seed=0)
    return made


def test_an_action_of_bools_is_zeros_and_ones():
    diagram = Diagram()
    for name, block in {"action": lab.Inlet(0.0, (2,), "bool"), "observation": lab.Outlet((2,), "bool")}.items():
        diagram.add(name, block)
    diagram.add("one", lab.Constant(1.0))
    diagram.add("reward", lab.Outlet())
    diagram.connect("action", "observation")
    diagram.connect("one", "reward")
    environment = DiagramEnv(diagram)
    environment.reset(seed=0)
    assert environment.step([1, 0])[0].tolist() == [1, 0]
    assert environment.step(np.array([False, True]))[0].tolist() == [0, 1]
    for action in ([0.5, 1], [np.nan, 0], [2, 0]):
        with pytest.raises(ValueError, match=r"action = \[.*\]: must be zeros and ones"):
            environment.step(action)


def test_a_policy_has_a_state_of_its_own():
    diagram = Diagram()
    diagram.add("observation", lab.Inlet(shape=(2,)))
    diagram.add("before", lab.UnitDelay(shape=(2,)))
    diagram.add("both", lab.Sum("+-", shape=(2,)))
    diagram.add("action", lab.Outlet(shape=(2,)))
    for source, target in (
        ("observation", "before"),
        ("observation", "both.u1"),
        ("before", "both.u2"),
        ("both", "action"),
    ):
        diagram.connect(source, target)
    policy = DiagramPolicy(diagram)
    np.testing.assert_allclose(policy([1.0, 2.0]), [1, 2])
    np.testing.assert_allclose(policy([1.5, 1.0]), [0.5, -1])
    policy.reset()
    np.testing.assert_allclose(policy([1.5, 1.0]), [1.5, 1])
    with pytest.raises(ValueError, match=r"observation\.shape = \(3,\): must be \(2,\)"):
        policy([1, 2, 3])
    with pytest.raises(ValueError, match=r"observation\.dtype = dtype\('<U4'\): must be a number's"):
        policy(["left", "up"])


@pytest.mark.ci
def test_grouped_blocks_compute_what_they_did_with_the_same_random_numbers():
    whole = cart()
    grouped = group(whole, ["noise", "push", "place"], "body")
    assert set(grouped.nodes) == set(whole.nodes) - {"noise", "push", "place"} | {"body"}
    assert set(whole.nodes) == set(cart().nodes)
    before, after = (Run(diagram, 3).advance(50) for diagram in (whole, grouped))
    np.testing.assert_allclose(after["observation.u"], before["observation.u"], rtol=1e-6)


PLANT = ["noise", "push", "place", "pay", "observation", "reward"]


def test_what_is_cut_out_has_its_open_wires_as_inlets():
    assert list(extract(cart(), PLANT).inputs) == ["action"]
    with pytest.raises(ValueError, match="unknown block 'plase': did you mean 'place'"):
        extract(cart(), ["plase"])


@pytest.mark.ci
def test_what_is_cut_out_runs_by_itself_as_an_environment():
    plant = extract(cart(), PLANT)
    environment, whole = DiagramEnv(plant), DiagramEnv(cart())
    for each in (environment, whole):
        each.reset(seed=4)
    np.testing.assert_allclose(environment.step([0.5])[0], whole.step([0.5])[0], rtol=1e-6)
