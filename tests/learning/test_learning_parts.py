"""Every registered part: it is documented, saved, checked, learns, resumes, and one program serves all its numbers."""

import dataclasses
import json
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from compiled_learner import refreshed, started

from families import compiled
from motorgrad.learning import (
    Accuracy,
    ActionValueEnsemble,
    ActionValueGradient,
    ActionValues,
    Agent,
    Annealed,
    Baseline,
    Centring,
    ConjugateAscent,
    Criterion,
    CriticFit,
    EntropyTarget,
    Estimator,
    Features,
    Growth,
    Hindsight,
    Learner,
    LinearCritic,
    Metric,
    Optimizer,
    PolyakAveraging,
    Replay,
    RewardCriterion,
    RewardScaling,
    RootMeanSquare,
    SoftActorCritic,
    SparseLearner,
    SpatialIndex,
    StepBound,
    Trace,
    Transition,
    Visited,
    number,
    register,
)
from motorgrad.policies import INITIAL, Architecture, FeatureMap, InitialPolicy, TileCoding
from motorgrad.schema import (
    PART_CLASSES,
    Numbers,
    Range,
    declared_at,
    declared_by,
    descriptions,
    fields_of,
    numbers_of,
    with_number,
)
from motorgrad.tasks import Composed, LinearRecruitment, ThreeState
from motorgrad.tasks.terms import Follow, Observation, Quantity, Reset, Target
from motorgrad.training import agent_for, agent_from_table, agent_table, clear_programs, stepper_for

DECISIONS = 8
BATCH = Estimator(update_every=2)


class Accumulating(Trace):
    r"""An exponential trace that adds each score in part, $z \leftarrow \beta z + (1 - \beta)\nabla\log\pi$."""

    decay: float = number(0.9, 0, 1, open_high=True, help=r"the factor $\beta$")

    def init(self, parameters):
        return jax.tree.map(jnp.zeros_like, parameters)

    def update(self, state, score):
        return jax.tree.map(lambda z, s: self.decay * z + (1 - self.decay) * s, state, score)

    def value(self, state):
        return state


# a part of one's own is tested as ours are
EVERY = [*((base, name) for base, parts in PART_CLASSES.items() for name in parts), (Trace, "test-accumulating")]
# composed tasks have tests of their own
PARTS = [(base, name) for base, name in EVERY if base not in (InitialPolicy, Observation, Quantity, Reset, Target)]
FEW = ("Trace-test-accumulating",)
SHARE = (
    "Baseline-critic",
    "Growth-constructive",
    "Learner-proximal",
    "Learner-sparse",
    "Metric-fisher",
)  # of those that compile
every_part_and_term = pytest.mark.parametrize(
    ("base", "name"), EVERY, ids=[f"{base.__name__}-{name}" for base, name in EVERY]
)
every_part = pytest.mark.parametrize(("base", "name"), PARTS, ids=[f"{base.__name__}-{name}" for base, name in PARTS])


def of_parts(*quick):
    """A test that compiles, of so few parts; in the share of some more, and of the others where all tests are run."""

    def marked(test):
        named = [(f"{base.__name__}-{name}", base, name) for base, name in PARTS]
        cases = [pytest.param(*part, id=id, marks=[pytest.mark.ci] * (id in SHARE)) for id, *part in named]
        return pytest.mark.representatives(*quick)(pytest.mark.parametrize(("base", "name"), cases)(test))

    return marked


@pytest.fixture(scope="module", autouse=True)
def _registered():
    register(Trace, "test-accumulating", Accumulating)
    yield
    del PART_CLASSES[Trace]["test-accumulating"]
    clear_programs()


def made(cls):
    """The part with its defaults; a number that has none is ½."""
    if cls is Follow:
        return Follow("hand", time=(0, 1), values=((0, 0, 0), (1, 1, 1)))
    missing = (f.name for f in dataclasses.fields(cls) if f.init and f.default is dataclasses.MISSING)
    return cls(**{name: INITIAL["softmax"]() if name == "policy" else 0.5 for name in missing})


def narrow(policy, values):
    """An action value gradient whose network is narrow: with wide ones, seeds side by side share some rounding."""
    network = dataclasses.replace(values.network, hidden=(4,))
    return ActionValueGradient(policy, dataclasses.replace(values, network=network))


def narrow_soft(policy, values=None, replay=None, entropy_target=None):
    """Soft actor-critic with narrow networks and little experience, which it uses from the first decisions."""
    values = ActionValueEnsemble() if values is None else values
    network = dataclasses.replace(values.network, hidden=(4,))
    replay = dataclasses.replace(Replay() if replay is None else replay, capacity=40, start=4, batch=3)
    values = dataclasses.replace(values, network=network)
    return SoftActorCritic(policy, values, replay, update_every=2, entropy_target=entropy_target)


def agent_with(base, name):
    """A learner that has the part in its place, and a task for it."""
    cls = PART_CLASSES[base][name]
    recruitment = LinearRecruitment(units=3)
    if base is Learner:
        task, settings = compiled(name)
        return task, agent_for(task, settings)
    if base in (Growth, Criterion, Visited):
        policy = INITIAL["growing"](units=3).bound(recruitment)
        field = {Growth: None, Criterion: "criterion", Visited: "placement"}[base]
        growth = made(cls) if field is None else Growth(**{field: made(cls)})
        return recruitment, Agent(policy, growth=growth)
    if base is SpatialIndex:
        return recruitment, SparseLearner(INITIAL["gaussians"]().bound(recruitment), index=made(cls))
    if base is FeatureMap:
        features = {"squares": True, "products": True, "nonlinear": 3}
        return ThreeState(), Agent(INITIAL["softmax"](features=features).bound(ThreeState()))
    if base is TileCoding:
        features = FeatureMap(tiles=made(cls))
        return ThreeState(), Agent(INITIAL["softmax"](features=features).bound(ThreeState()))
    if base is Hindsight:
        task = Composed(scaling="none")
        replay = Replay(capacity=40, start=4, batch=3, hindsight=made(cls))
        return task, narrow_soft(INITIAL["bounded-hyperplanes"]().bound(task), replay=replay)
    if base is Architecture:
        return ThreeState(), Agent(INITIAL["softmax"](network=made(cls)).bound(ThreeState()))
    graded = INITIAL["graded-motoneurons"]().bound(recruitment)
    of_values = {
        ActionValues: lambda: narrow(graded, made(cls)),
        ActionValueEnsemble: lambda: narrow_soft(graded, made(cls)),
        EntropyTarget: lambda: narrow_soft(graded, entropy_target=made(cls)),
        Replay: lambda: narrow_soft(graded, replay=made(cls)),
    }
    if cls in of_values:
        return recruitment, of_values[cls]()
    inner = {
        Trace: lambda: {"estimator": Estimator(trace=made(cls))},
        Baseline: lambda: {"estimator": Estimator(baseline=made(cls))},
        CriticFit: lambda: {"estimator": Estimator(baseline=LinearCritic(fit=made(cls)))},
        Centring: lambda: {"estimator": Estimator(baseline=LinearCritic(centring=made(cls)))},
        Features: lambda: {"estimator": Estimator(baseline=LinearCritic(made(cls)))},
        StepBound: lambda: {"estimator": Estimator(bound=made(cls))},
        RewardCriterion: lambda: {"estimator": Estimator(criterion=made(cls))},
        RewardScaling: lambda: {"estimator": Estimator(reward_scaling=made(cls))},
        Accuracy: lambda: {"estimator": Estimator(update_every=1_000, accuracy=made(cls))},
        RootMeanSquare: lambda: {"estimator": Estimator(normalization=made(cls))},
        Annealed: lambda: {"estimator": Estimator(entropy=made(cls))},
        Estimator: lambda: {"estimator": made(cls)},
        Optimizer: lambda: {"optimizer": made(cls), **({"estimator": BATCH} if cls is ConjugateAscent else {})},
        Metric: lambda: {"metric": made(cls)},
        PolyakAveraging: lambda: {"averaging": made(cls)},
    }[base]()
    task = ThreeState()
    agent = Agent(INITIAL["softmax"]().bound(task), **inner)
    if agent.needs.episodes:
        task = ThreeState(time_limit=5)
        agent = Agent(INITIAL["softmax"]().bound(task), **inner)
    return task, agent


def nudged(agent):
    """The learner with every number elsewhere in its range."""
    for path, value in numbers_of(agent.hyperparameters).items():
        low, high, *_ = declared_at(agent.hyperparameters, path).range or Range()
        if np.ndim(value):
            continue
        far = high if value - low < high - value else low
        value = value + 0.25 * (far - value) if math.isfinite(far) else 1.5 * value + 0.1
        agent = with_number(agent, path, value)
    return agent


@every_part_and_term
def test_every_field_is_documented(base, name):
    cls = PART_CLASSES[base][name]
    said = descriptions(cls)
    assert [field for field in fields_of(cls) if not said.get(field)] == []
    assert (cls.__doc__ or "").strip()


@every_part
def test_a_saved_learner_is_the_same(base, name):
    task, agent = agent_with(base, name)
    for each in (agent, nudged(agent)):
        saved = json.loads(json.dumps(agent_table(each)))
        assert agent_from_table(task, saved) == each
    text = json.dumps(agent_table(agent))
    # a table without a kind is of the policy gradient; features are a policy's only kind of them
    assert f'"{name}"' in text or (base, name) in ((Learner, "policy-gradient"), (FeatureMap, "map"))


@every_part_and_term
def test_a_value_outside_its_range_is_refused(base, name):
    cls = PART_CLASSES[base][name]
    part = made(cls)
    for field, declared in fields_of(cls).items():
        bad = []
        allowed = declared_by(declared).range
        if allowed is not None and not allowed.whole:
            low, high, open_low, open_high, _ = allowed
            bad = [math.nan, math.inf, True, "1"]
            bad += [low if open_low else low - 1] if math.isfinite(low) else []
            bad += [high if open_high else high + 1] if math.isfinite(high) else []
        elif allowed is not None:
            low, high, *_ = allowed
            bad = [low - 1, high + 1, low + 0.5, True, "1"]
        several = isinstance(getattr(part, field, None), tuple)
        for value in bad:
            with pytest.raises(ValueError, match=rf"^{field}{'.0.' * several} = "):
                dataclasses.replace(part, **{field: (value,) if several else value})


@of_parts(*FEW)
def test_one_program_serves_all_numbers_as_if_they_were_constants(base, name):
    task, agent = agent_with(base, name)
    goal = () if agent.needs.goal is None else (task.hindsight,)
    sparse = isinstance(agent, SparseLearner)
    other, order, traces = nudged(agent), Numbers(agent.hyperparameters), 0
    assert Numbers(other.hyperparameters).key == order.key
    policy = jax.eval_shape(agent.init, jax.random.key(0)).policy
    rng = np.random.default_rng(0)
    looks = rng.uniform(size=(DECISIONS + 1, policy.inputs)).astype(np.float32)
    uniforms = rng.uniform(size=(DECISIONS, policy.uniforms)).astype(np.float32)
    rewards, ends = rng.normal(size=DECISIONS).astype(np.float32), np.arange(DECISIONS) % 4 == 3

    def live(learner, state):
        def decide(state, now):
            look, after, number, reward, ended = now
            state, action = learner.act(state, look, number)
            state = learner.observe(state, Transition(look, action, reward, after, terminated=ended))
            return learner.update(state, *goal), None

        room = uniforms[:, : state.index.table.shape[-1]] if sparse else uniforms
        state = jax.lax.scan(decide, state, (looks[:-1], looks[1:], room, rewards, ends))[0]
        return learner.publish(state) if sparse else state

    def start(learner):
        return refreshed(agent, started(learner)) if sparse else started(learner)

    @jax.jit
    def by_vector(vector, state):
        nonlocal traces
        traces += 1
        return live(agent.with_numbers(order, vector), state)

    found = [by_vector(order.vector(each.hyperparameters), start(each)) for each in (agent, other)]
    assert traces == 1
    constant = jax.jit(lambda state: live(other, state))(start(other))
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, rtol=1e-5, atol=1e-6), found[1], constant)
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(found[0].policy))


@of_parts("Metric-fisher")
def test_a_learner_resumes_from_its_state_and_its_seeds_do_not_touch(base, name):
    task, agent = agent_with(base, name)
    whole, parts, again, more = (stepper_for(task, agent, seeds) for seeds in ([0, 1], [0, 1], [0, 1], [0, 1, 2]))
    for stepper in (whole, more):
        stepper.advance(12)
    parts.advance(5)
    again.restore(parts.state)
    again.advance(7)
    jax.tree.map(np.testing.assert_array_equal, again.state, whole.state)
    first = jax.tree.map(lambda leaf: leaf[:2], more.policies())
    # for another number of seeds, what a body shows is rounded differently
    tolerance = {"rtol": 1e-4, "atol": 1e-9} if base is Hindsight else {"rtol": 0}
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, **tolerance), first, whole.policies())
    other = nudged(agent)
    after = numbers_of(other.hyperparameters)
    lanes = {path: [value, after[path]] for path, value in numbers_of(agent.hyperparameters).items()}
    swept = stepper_for(task, agent, [0, 1], numbers=lanes)
    swept.advance(12)
    plain = stepper_for(task, other, [0, 1])
    plain.advance(12)
    mixed = jax.tree.map(lambda a, b: np.stack([a[0], b[1]]), whole.policies(), plain.policies())
    jax.tree.map(np.testing.assert_array_equal, swept.policies(), mixed)
