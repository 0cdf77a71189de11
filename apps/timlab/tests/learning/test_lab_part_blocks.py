"""Blocks derived from the parts of learners: what is registered has a block, and numbers are live parameters."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import motorgrad as mg
import timlab
from motorgrad import learning
from motorgrad.schema import PART_CLASSES, Range, declared_by, fields_of
from timlab.blocks.learning import PART_BLOCKS
from timlab.diagram import blocks_of
from timlab.diagram._verify import function_problems
from timlab.editor._edits import SetParameter
from timlab.editor._program import signature
from timlab.editor._views import declaration, view_of_node

SIZE = 3


class Fading(learning.Trace):
    """Keeps a share of every score, several times over."""

    fade: float = learning.number(0.5, 0, 1, open_high=True, unit="decisions", help="how much is left")
    steps: int = learning.count(2, 1, 9, help="how often it fades")

    def init(self, parameters):
        return jax.tree.map(jnp.zeros_like, parameters)

    def update(self, state, score):
        return jax.tree.map(lambda z, s: self.fade**self.steps * z + s, state, score)

    def value(self, state):
        return state


class Half(learning.Baseline):
    """Half of the reward."""

    def init(self, policy, dtype):
        return jnp.zeros((), dtype)

    def level(self, state):
        return state

    def update(self, state, policy, transition):
        return learning.Advantage(transition.reward / 2, transition.reward / 2), state + 1


@pytest.fixture
def registered():
    learning.register(learning.Trace, "fading", Fading)
    learning.register(learning.Baseline, "half", Half)
    yield
    del PART_CLASSES[learning.Trace]["fading"], PART_CLASSES[learning.Baseline]["half"]


def test_a_registered_part_has_a_block(registered):
    kind = timlab.BLOCKS["fading trace"]
    assert kind is timlab.FadingTrace
    assert "fading trace" in list(timlab.BLOCKS)
    assert "Keeps a share" in kind.__doc__
    fade = timlab.parameters_of(kind)["fade"]
    assert fade == declared_by(fields_of(Fading)["fade"])
    assert timlab.settings_of(kind)["steps"].help == "how often it fades"
    told = {field["name"]: field for field in declaration(kind)["fields"]}
    assert (told["fade"]["default"], told["fade"]["allowed"]) == (0.5, "in [0, 1), in decisions")
    assert (told["steps"]["low"], told["steps"]["high"], told["steps"]["help"]) == (1, 9, "how often it fades")
    for wrong in ({"fade": 1.0}, {"fade": 2.0}, {"steps": 0}, {"steps": "two"}):
        with pytest.raises(ValueError, match=rf"^{next(iter(wrong))} = "):
            kind(**wrong)

    made = timlab.Diagram(tick=1.0)
    made.add("score", timlab.Constant(1.0, (SIZE,)))
    made.add("trace", kind(size=SIZE))
    made.add("half", timlab.HalfBaseline())
    made.add("reward", timlab.Constant(3.0))
    made.connect("score", "trace.score")
    made.connect("reward", "half.reward")
    assert timlab.loads(timlab.dumps(made)) == made
    assert "timlab.FadingTrace(size=3)" in timlab.to_python(made)
    run = timlab.Run(made, 1, watch=["trace.trace", "half.error"])
    record = run.advance(4)
    np.testing.assert_allclose(record["trace.trace"][0, :, 0], [0, 1, 1.25, 1.3125])
    np.testing.assert_allclose(record["half.error"][0], [0, 1.5, 1.5, 1.5])
    run["trace.fade"] = 0.0
    np.testing.assert_allclose(run.advance(2)["trace.trace"][0, :, 0], [1.328125, 1.0])
    assert run.compilations == 1


def test_what_is_no_longer_registered_has_no_block():
    assert "fading trace" not in timlab.BLOCKS
    with pytest.raises(AttributeError, match="FadingTrace"):
        _ = timlab.FadingTrace


LATER = {"network-critic baseline": pytest.mark.ci}  # has the fields of the critic and of the network


@pytest.mark.parametrize("name", [pytest.param(name, marks=LATER.get(name, ())) for name in PART_BLOCKS])
def test_every_part_block_keeps_what_it_declares(name):
    kind = PART_BLOCKS[name]
    assert kind.name == name
    assert getattr(timlab, kind.__name__) is kind
    block = kind()
    assert list(function_problems(block)) == []
    declared = {**timlab.parameters_of(kind), **timlab.settings_of(kind)}
    assert all(part.help for part in declared.values())
    for path, field in kind.places.items():
        assert "." in path or declared[field] is declared_by(fields_of(kind.part)[path])
    for field in timlab.parameters_of(kind):
        if getattr(block, field) is None:
            present = block.retuned({field: 0.5})
            assert list(function_problems(present)) == []
            assert field in present.parameters
            assert field not in block.parameters


def test_an_optimizer_with_weight_decay_asks_for_the_parameters():
    assert "parameters" not in timlab.SGD().inputs
    assert "parameters" not in timlab.Adam().inputs
    assert "parameters" in timlab.Adam(weight_decay=0.1).inputs
    assert "parameters" in timlab.SGD(weight_decay=0.0).inputs  # presence is structure, not the value


def test_presence_does_not_change_while_it_runs():
    made = timlab.Diagram(tick=1.0)
    made.add("gradient", timlab.Constant(1.0, (1,)))
    made.add("optimizer", timlab.SGD())
    made.connect("gradient", "optimizer.gradient")
    run = timlab.Run(made, 1)
    with pytest.raises(ValueError, match="unknown parameter of optimizer: 'weight_decay'"):
        run["optimizer.weight_decay"] = 0.1
    present = SetParameter("optimizer.weight_decay", 0.1).apply(made)
    assert blocks_of(present)["optimizer"].weight_decay == 0.1
    assert blocks_of(SetParameter("optimizer.weight_decay", None).apply(present))["optimizer"].weight_decay is None


SETTINGS = "policy = 'softmax'\nlearning_rate = 0.01\ndecay = 0.8\nmetric = 'fisher'\n"


PLAIN = "policy = 'softmax'\nlearning_rate = 0.01\ndecay = 0.8\n"  # quicker to compile
SEEDS = [3, 4, 11]


def learner_diagram(settings=PLAIN):
    made = timlab.Diagram(tick=1.0)
    made.add("world", timlab.World("three-state"))
    made.add("policy", timlab.Learner(2, 2, settings))
    for port in ("observation", "reward", "next_observation", "terminated", "truncated", "valid"):
        made.connect(f"world.{port}", f"policy.{port}")
    made.connect("policy.action", "world.action")
    return made


def test_the_numbers_of_a_learner_are_parameters_by_path():
    block = timlab.Learner(2, 2, SETTINGS)
    parameters = block.parameters
    assert set(parameters) >= {"estimator.trace.decay", "optimizer.learning_rate", "metric.rate", "metric.damping"}
    decay = parameters["estimator.trace.decay"]
    assert decay.range == Range(0, 1)
    assert "per decision" in decay.help
    after = block.retuned({"estimator.trace.decay": 0.5, "metric.rate": 0.2, "frozen": True})
    assert after.frozen
    assert after.parameters == parameters
    assert getattr(after, "estimator.trace.decay") == 0.5
    assert getattr(after, "optimizer.learning_rate") == 0.01
    assert after.structure == block.structure
    assert timlab.Learner(2, 2, after.settings, frozen=True) == after
    assert timlab.Learner(2, 2, SETTINGS + "[averaging]\n").structure != block.structure
    with pytest.raises(ValueError, match=r"estimator\.trace\.decay = 1\.5"):
        block.retuned({"estimator.trace.decay": 1.5})


def test_a_number_of_a_learner_is_retuned_while_it_runs_and_compiles_nothing():
    run = timlab.Run(learner_diagram(), SEEDS, watch=["policy.parameters"])
    run.advance(200)
    then = run.state
    run["policy.optimizer.learning_rate"] = 0.0
    assert np.ptp(run.advance(100)["policy.parameters"], axis=1).max() == 0
    run.restore(then)
    run["policy.estimator.trace.decay"] = 0.2
    ours = run.advance(101)["policy.parameters"][:, -1]
    assert run["policy.estimator.trace.decay"] == 0.2
    assert run.compilations == 1

    task = mg.make("three-state")
    theirs = mg.training.stepper_for(task, mg.agent_for(task, policy="softmax", learning_rate=0.01, decay=0.8), SEEDS)
    theirs.advance(200)
    theirs.set_number("estimator.trace.decay", 0.2)
    theirs.advance(100)
    np.testing.assert_allclose(ours, np.asarray(theirs.policies().weights).reshape(3, -1), rtol=0, atol=1e-4)


@pytest.mark.ci
def test_learners_of_one_structure_are_compiled_as_one_and_swept():
    made = learner_diagram()
    rates = [0.0, 0.02]
    run = timlab.Run(made, 2, watch=["policy.parameters"], sweep={"policy.optimizer.learning_rate": rates})
    moved = np.ptp(run.advance(60)["policy.parameters"], axis=1).max(axis=1)
    assert moved[0] == 0
    assert moved[1] > 0


def test_learners_of_one_structure_have_one_signature():
    made = learner_diagram()
    again = SetParameter("policy.optimizer.learning_rate", 0.5).apply(made)
    assert signature(again) == signature(made)
    assert "learning_rate = 0.5" in blocks_of(again)["policy"].settings


def test_the_editor_is_told_of_a_learners_numbers():
    view = view_of_node(learner_diagram(), "policy")
    told = {field["name"]: field for field in view["parameters"]}
    rate = told["optimizer.learning_rate"]
    assert (rate["role"], rate["low"], rate["high"], rate["default"]) == ("parameter", 0.0, None, 0.01)
    assert view["fields"]["optimizer.learning_rate"] == 0.01
    assert "parameters" not in view_of_node(learner_diagram(), "world")
