"""The policies that every policy test runs over.

An example is a function of a NumPy generator, so that a test can draw as many parameter settings as it likes. A new
kind of policy in `motorgrad.policies.INITIAL` gets an example by itself; list others only where they add something.
"""

import contextlib
import functools
from collections.abc import Callable, Iterable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree

from motorgrad.policies import (
    INITIAL,
    Alternating,
    Factored,
    Featured,
    FeatureMap,
    FiniteStateController,
    FreeGaussians,
    Gated,
    Hyperplanes,
    Layered,
    LocalGaussians,
    Masked,
    Mirrored,
    Mosaic,
    Motoneurons,
    MultilayerPerceptron,
    Network,
    OrientedBoxes,
    OrientedGaussians,
    Policy,
    Recurrent,
    SoftBoxes,
    Softmax,
    SoftSpheres,
    SpikingUnits,
    Tied,
    abilities,
    initial,
    split,
)
from motorgrad.worlds import AdmissionThresholds

Rng = np.random.Generator


def _motoneurons(rng: Rng, units: int = 3) -> Motoneurons:
    return Motoneurons(rng.normal(size=units), rng.normal(size=units, scale=3))


def _hyperplanes(rng: Rng, units: int = 3, inputs: int = 2) -> Hyperplanes:
    return Hyperplanes(rng.normal(size=(units, inputs)), rng.normal(size=units))


def _local(rng: Rng, units: int = 3, inputs: int = 2, p_max=1.0) -> LocalGaussians:
    return LocalGaussians(rng.normal(size=(units, inputs)), rng.normal(size=(units, inputs), scale=0.5), p_max)


def _free(rng: Rng, units: int = 3, inputs: int = 2) -> FreeGaussians:
    shape = (units, inputs)
    return FreeGaussians(rng.normal(size=shape), rng.normal(size=shape, scale=0.5), rng.normal(size=units))


def _spheres(rng: Rng, units: int = 3, inputs: int = 2) -> SoftSpheres:
    return SoftSpheres(rng.normal(size=(units, inputs)), rng.normal(size=units, scale=0.5), rng.normal(1, size=units))


def _boxes(rng: Rng, units: int = 3, inputs: int = 2) -> SoftBoxes:
    shape = (units, inputs)
    return SoftBoxes(rng.normal(size=shape), rng.normal(size=shape, scale=0.5), rng.normal(1, size=units))


def _oriented(rng: Rng, units: int = 3, inputs: int = 2, wide: float = 0.0, shear: float = 2.0) -> OrientedGaussians:
    shape = (units, inputs)
    shears = rng.normal(size=(units, inputs * (inputs - 1) // 2), scale=shear)
    return OrientedGaussians(rng.normal(size=shape), rng.normal(wide, 0.5, shape), shears, rng.uniform(0.1, 1))


def _turned(rng: Rng, units: int = 3, inputs: int = 2) -> OrientedBoxes:
    boxes = _boxes(rng, units, inputs)
    turn = rng.normal(size=(units, inputs * (inputs - 1) // 2), scale=2)
    return OrientedBoxes(boxes.centre, boxes.log_width, boxes.log_hardness, turn)


@functools.cache
def _layers(inputs: int, outputs: int) -> Any:
    build = MultilayerPerceptron(hidden=(4, outputs)).build
    layers = eqx.filter_eval_shape(build, inputs, jax.random.key(0))
    return eqx.partition(layers, lambda leaf: isinstance(leaf, jax.ShapeDtypeStruct))


def _network(rng: Rng, pool: Policy, inputs: int = 2) -> Network:
    # of the layers the shapes alone are of use: JAX's random numbers are others in double precision
    shapes, rest = _layers(inputs, pool.inputs)
    drawn = jax.tree.map(lambda x: jnp.asarray(rng.normal(size=x.shape)), shapes)
    return Network(pool, eqx.combine(drawn, rest), inputs)


def _mirrored_pool(rng: Rng) -> Featured:
    features = FeatureMap(squares=True)
    return Featured(_network(rng, _hyperplanes(rng, 2, 3), features.size(2)), features, 2)


def _gated(rng: Rng) -> Gated:
    return Gated(_local(rng, 2), [_hyperplanes(rng, 2), Factored([_spheres(rng, 1)])])


def _softmax(rng: Rng, actions: int, inputs: int) -> Softmax:
    return Softmax(rng.normal(size=(actions, inputs)))


def _layered(rng: Rng) -> Layered:
    return Layered([_hyperplanes(rng, 2), _softmax(rng, 3, 3), _local(rng, 1, 1)], _hyperplanes(rng, 2, 1))


def _recurrent(rng: Rng) -> Recurrent:
    return Recurrent(rng.normal(size=2), rng.normal(size=(2, 3)), rng.normal(size=2), _hyperplanes(rng, 2, 5))


EXAMPLES: dict[str, Callable[[Rng], Policy]] = {
    "motoneurons": _motoneurons,
    "hyperplanes": _hyperplanes,
    "local-gaussians": _local,
    "local-gaussians-p-max": lambda rng: _local(rng, p_max=rng.uniform(0.1, 0.9, size=3)),
    "free-gaussians": _free,
    "factored": lambda rng: Factored([_hyperplanes(rng, 1), _local(rng, 1), _free(rng, 2)]),
    "factored-nested": lambda rng: Factored(
        [Factored([_local(rng, 1, 1, 0.7), _motoneurons(rng, 1)]), Factored([Factored([_hyperplanes(rng, 2, 1)])])]
    ),
    "soft-spheres": _spheres,
    "soft-boxes": _boxes,
    "oriented-gaussians": _oriented,
    "oriented-gaussians-4": lambda rng: _oriented(rng, 2, 4, 1.0, 0.5),
    "oriented-boxes": _turned,
    "oriented-boxes-4": lambda rng: _turned(rng, 2, 4),
    "masked": lambda rng: Masked(_local(rng, 4), np.array([True, False, True, True])),
    "mirrored": lambda rng: Mirrored(_hyperplanes(rng, 2, 3), (1, 0, 2), (1, 1, -1), (0, 3), (2, 1)),
    "mirrored-local": lambda rng: Mirrored(Factored([_local(rng, 1), _boxes(rng, 1)]), (0, 1), (1, -1), (0, 1), (2, 3)),
    "mirrored-network": lambda rng: Mirrored(_mirrored_pool(rng), (0, 1), (1, -1), (0, 3), (2, 1)),
    "tied": lambda rng: Tied(_motoneurons(rng, 2), (0, 1, 0)),
    "alternating": lambda rng: Alternating(Factored([_hyperplanes(rng, 1), _local(rng, 2)]), turns=2),
    "gated": _gated,
    "gated-nested": lambda rng: Gated(
        _hyperplanes(rng, 1), [Factored([Gated(_boxes(rng, 1), [_local(rng, 1)]), _hyperplanes(rng, 1)])]
    ),
    "factored-gated": lambda rng: Factored([Gated(_local(rng, 1), [_spheres(rng, 2)]), _free(rng, 1)]),
    "network": lambda rng: _network(rng, Factored([_hyperplanes(rng, 2, 3), _local(rng, 1, 3)])),
    "network-softmax": lambda rng: _network(rng, Softmax(rng.normal(size=(3, 4)))),
    "softmax-2": lambda rng: Softmax(rng.normal(size=(2, 3))),
    "softmax-5": lambda rng: Softmax(rng.normal(size=(5, 3))),
    "layered": _layered,
    "layered-skip": lambda rng: Layered([_hyperplanes(rng, 2)], _softmax(rng, 3, 5), skip=True),
    "controller": lambda rng: FiniteStateController(_softmax(rng, 3, 6), _hyperplanes(rng, 2, 6)),
    "controller-softmax": lambda rng: FiniteStateController(_softmax(rng, 2, 4), _softmax(rng, 3, 4)),
    "recurrent": _recurrent,
    "mosaic": lambda rng: Mosaic(_hyperplanes(rng, 2, 9), rng.normal(size=(3, 2, 5)), 0.5, 0.1),
    "spiking": lambda rng: SpikingUnits(rng.normal(size=(3, 2)), rng.normal(size=3)),
    "admission-thresholds": lambda rng: AdmissionThresholds(rng.normal(size=3), rng.uniform(0.5, 2)),
}

REPRESENTATIVES = ("local-gaussians-p-max", "gated", "softmax-5", "layered-skip")
"""The examples that `make test` runs: an array as a setting, discrete actions, and the ways of putting policies
together that have sums of their own: pools behind gates, one of them a pool of pools, and hidden units. Networks,
mirrors and pools of pools ask what they hold, and have tests of their own."""


def policy_of(name: str, seed: int = 0) -> Policy:
    """The example called `name` with the parameters of one seed, in JAX's present precision."""
    return EXAMPLES[name](np.random.default_rng(seed))


def observation_of(policy: Policy, seed: int = 0, scale: float = 1.0) -> jax.Array:
    """A random observation for `policy`."""
    return jnp.asarray(np.random.default_rng([seed, 1]).normal(size=policy.inputs, scale=scale))


compiled = functools.partial(eqx.filter_jit, compiler_options={"xla_backend_optimization_level": 0})
"""Compile a function once for all policies of one structure, for tests that compare formulas: these programs run a few
times, and the compiler takes half the time if it need not make them fast. What is told of machine arithmetic, in
single precision, is compiled as users compile it."""


def bound(policy: Policy, method: str) -> Callable[..., Any]:
    """A method of a policy, or the question of `motorgrad.policies.abilities` of this name about it."""
    question = getattr(abilities, method, None)
    return getattr(policy, method) if question is None else functools.partial(question, policy)


@compiled
def call(policy: Policy, method: str, *arguments: Any) -> Any:
    """A method, or the ability of this name, of a policy, compiled once for all policies of one shape."""
    return bound(policy, method)(*arguments)


class Compiled:
    """A policy whose methods are compiled, one program for all policies of one structure, and answer in NumPy."""

    def __init__(self, policy: Policy):
        self._policy = policy

    def __getattr__(self, method: str) -> Callable[..., Any]:
        return lambda *arguments: jax.tree.map(np.asarray, call(self._policy, method, *arguments))

    def over(self, method: str, observation: Any, actions: Any) -> Any:
        """A method of (observation, action) for many actions, along a leading axis."""
        return jax.tree.map(np.asarray, _over(self._policy, method, observation, actions))

    def samples(self, observation: Any, uniforms: Any) -> np.ndarray:
        return np.asarray(samples(self._policy, observation, uniforms))

    def derivatives(self, observation: Any, actions: Any) -> np.ndarray:
        """The derivative of the log-probability of each action by automatic differentiation, (actions, parameters)."""
        return np.asarray(_derivatives(self._policy, observation, actions))

    def scores(self, observation: Any, actions: Any) -> np.ndarray:
        """The analytic score of each action, (actions, parameters)."""
        return np.asarray(_scores(self._policy, observation, actions))


def scores_of_draws(policy: Policy, observation: Any, uniforms: Any) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Actions that are drawn, and the score of each: analytic, and by automatic differentiation."""
    actions = jax.vmap(policy.sample, (None, 0))(observation, uniforms)
    return actions, _score(policy, observation, actions), _derivative(policy, observation, actions)


@eqx.filter_jit
def samples(policy: Policy, observation: Any, uniforms: Any) -> jax.Array:
    return jax.vmap(policy.sample, (None, 0))(observation, uniforms)


@compiled
def _over(policy: Policy, method: str, observation: Any, actions: Any) -> Any:
    return jax.vmap(bound(policy, method), (None, 0))(observation, actions)


def _score(policy: Policy, observation: Any, actions: Any) -> jax.Array:
    return jax.vmap(lambda action: ravel_pytree(policy.score(observation, action))[0])(actions)


def _derivative(policy: Policy, observation: Any, actions: Any) -> jax.Array:
    parameters, rest = split(policy)
    derivative = jax.grad(lambda theta, action: eqx.combine(theta, rest).log_prob(observation, action))
    return jax.vmap(lambda action: ravel_pytree(derivative(parameters, action))[0])(actions)


def _answer(policy: Policy, observation: Any, differentiated: bool) -> dict[str, Any]:
    """What is asked about every action: its log-probability and its score; and what sums of these must be."""
    parameters, rest = split(policy)
    actions = abilities.enumerate(policy)

    def log_prob(theta: Policy, action: jax.Array) -> jax.Array:
        return eqx.combine(theta, rest).log_prob(observation, action)

    def over(method: Callable[..., Any]) -> jax.Array:
        return jax.vmap(lambda action: ravel_pytree(method(action))[0])(actions)

    answer = {
        "action": actions,
        "emitted": jax.vmap(lambda action: abilities.task_action(policy, action))(actions),
        "log_prob": over(lambda action: policy.log_prob(observation, action))[:, 0],
        "score": over(lambda action: policy.score(observation, action)),
        "prob": policy.prob(observation),
        "entropy": policy.entropy(observation),
        "log_prob at the mode": policy.log_prob(observation, policy.mode(observation)),
    }
    if differentiated:
        answer["derivative"] = over(lambda action: jax.grad(log_prob)(parameters, action))
    return answer


_answer_once, _answer_fast = compiled(_answer), eqx.filter_jit(_answer)


@compiled
def _answer_each(policies: Policy, observations: Any) -> dict[str, Any]:
    return jax.vmap(lambda policy, observation: _answer(policy, observation, True))(policies, observations)


CASES = 40


def observation_in(case: int, policy: Policy) -> jax.Array:
    """The observation of a case: from small to large."""
    return observation_of(policy, 1000 + case, 10.0 ** np.linspace(-2, 1, CASES)[case])


@functools.cache
def answers(name: str) -> list[dict[str, np.ndarray]]:
    """What the example called `name` answers in double precision in each case: with the parameters of that seed."""
    with jax.enable_x64(True):
        policies = [policy_of(name, seed) for seed in range(CASES)]
        seen = [observation_in(case, policy) for case, policy in enumerate(policies)]
        stacked = jax.tree.map(lambda *leaves: np.stack(leaves), *policies)
        found = jax.tree.map(np.asarray, _answer_each(stacked, np.stack(seen)))
    return [{question: answer[k] for question, answer in found.items()} for k in range(CASES)]


@functools.cache
def answers_at(place: str, double: bool) -> dict[str, np.ndarray]:
    """What the policy of `EXTREMES` called `place` answers there, with derivatives in double precision."""
    with jax.enable_x64(double):
        policy, observation = EXTREMES[place]()
        ask = _answer_once if double else _answer_fast
        return jax.tree.map(np.asarray, ask(policy, jnp.asarray(observation), double))


_scores, _derivatives, drawn_scores = compiled(_score), compiled(_derivative), compiled(scores_of_draws)


@compiled
def over_actions(policy: Policy, method: str, observation: Any) -> Any:
    """A method of (observation, action) for every action, along a leading axis."""
    return jax.vmap(lambda action: bound(policy, method)(observation, action))(abilities.enumerate(policy))


@functools.cache
def _start(name: str, precision: Any) -> Policy | Callable[[jax.Array], Policy]:
    del precision  # in which arrays are made
    for inputs, units in ((2, 3), (1, 3), (3, 6)):
        with contextlib.suppress(ValueError):  # some policies need a single input, or several
            return initial(name, inputs, units=units)
    raise ValueError(f"{name}: no size will do")


def from_initial(name: str, rng: Rng) -> Policy:
    """The initial policy called `name`, with random numbers added to its parameters."""
    return moved(started(_start(name, jnp.result_type(float)), rng.integers(2**31)), rng)


def started(start: Policy | Callable[[jax.Array], Policy], seed: int = 0) -> Policy:
    """An initial policy, compiled as a whole if it is a function of a key."""
    return start if isinstance(start, Policy) else compiled(start)(jax.random.key(seed))


def moved(policy: Policy, rng: Rng, scale: float = 1.0) -> Policy:
    """A policy with random numbers added to its parameters."""
    learned, rest = split(policy)

    def elsewhere(x: jax.Array) -> jax.Array:
        drawn = np.asarray(rng.normal(size=x.shape), x.dtype)  # NumPy compiles nothing
        return jnp.asarray(np.asarray(x) + scale * drawn, x.dtype)

    return eqx.combine(jax.tree.map(elsewhere, learned), rest)


def unlisted(names: Iterable[str]) -> dict[str, Callable[[Rng], Policy]]:
    """Examples of those policies in `INITIAL` whose kind has none above and whose actions can be enumerated."""
    found, listed = {}, set()
    for name in sorted(names):
        listed = listed or {type(make(np.random.default_rng(0))) for make in EXAMPLES.values()}
        policy = from_initial(name, np.random.default_rng(0))
        if type(policy) not in listed and policy.actions in ("binary", "discrete"):
            found[name] = functools.partial(from_initial, name)
    return found


def without_task() -> set[str]:
    """The initial policies that can be made of sizes alone; the other needs a task with a mirror."""
    return INITIAL.keys() - {"mirrored"}


KNOWN = {
    *(
        "alternating-motoneurons",
        "bounded-hyperplanes",
        "finite-state-controller",
        "gated",
        "gaussians",
        "graded-hyperplanes",
    ),
    *("graded-motoneurons", "graded-tiles", "growing", "hyperplanes", "layered", "mixed", "mixture", "motoneurons"),
    "mosaic",
    *("oriented-boxes", "oriented-gaussians"),
    *("primitives", "querying-motoneurons", "recurrent", "soft-boxes", "soft-spheres", "softmax", "spiking"),
    *("tied-motoneurons", "tiles"),
}
"""Initial policies that need no further example, so that an import of this file makes no policy. A test asks whether
this is so."""

_FOUND = unlisted(without_task() - KNOWN)
EXAMPLES |= _FOUND

HIDING = {"layered", "layered-skip", "controller", "controller-softmax"}
HIDING |= {name for name in _FOUND if abilities.has_hidden_units(policy_of(name))}
"""The examples of which the task gets only a part of what they draw. A test asks whether this is so."""

DEPENDENT = {"gated", "gated-nested", "factored-gated", "tied"}
DEPENDENT |= {name for name in _FOUND if not getattr(policy_of(name), "independent", True)}
"""The examples whose units fire or not by what others do. A test asks whether this is so."""


def _motoneurons_at(potential: float) -> tuple[Policy, np.ndarray]:
    return Motoneurons([0.25, -0.5], [potential, -potential]), np.array([1.25])


def _hyperplanes_at(potential: float) -> tuple[Policy, np.ndarray]:
    return Hyperplanes([[potential, 0.0], [-potential, 0.0]], [0.0, 0.0]), np.array([1.0, -2.0])


def _softmax_at(potential: float, actions: int) -> tuple[Policy, np.ndarray]:
    return Softmax(np.linspace(0, potential, actions)[:, None]), np.array([1.0])


def _gaussians_at(widths: float, p_max: float = 1.0) -> tuple[Policy, np.ndarray]:
    return LocalGaussians([[0.0, 1.0], [0.0, 0.0]], [[0.0, -1.0], [1.0, 0.0]], p_max), np.array([widths, 1.0])


def _free_at(widths: float, log_mass: float) -> tuple[Policy, np.ndarray]:
    return FreeGaussians([[0.0], [0.5]], [[0.0], [-1.0]], [log_mass, 0.0]), np.array([widths])


def _mixed_at(potential: float, widths: float) -> tuple[Policy, np.ndarray]:
    pools = (
        Motoneurons([0.0], [potential]),
        LocalGaussians([[1.0 - widths]], [[0.0]]),
        Hyperplanes([[potential]], [0.0]),
    )
    return Factored(pools), np.array([1.0])


def _sphere_at(distance: float, hardness: float = 0.0) -> tuple[Policy, np.ndarray]:
    return SoftSpheres([[0.0, 1.0], [0.0, 0.0]], [0.0, -1.0], [hardness, 1.0]), np.array([distance, 1.0])


def _box_at(distance: float, hardness: float) -> tuple[SoftBoxes, np.ndarray]:
    return SoftBoxes([[0.0, 1.0], [0.0, 0.0]], [[0.0, 0.0], [1.0, 0.5]], [hardness, 1.0]), np.array([distance, 1.0])


def _oriented_at(widths: float, shear: float) -> tuple[Policy, np.ndarray]:
    shears = [[shear], [-shear]]
    return OrientedGaussians([[0.0, 1.0], [0.0, 0.0]], [[0.0, -1.0], [1.0, 0.0]], shears), np.array([widths, 1.0])


def _turned_at(distance: float, hardness: float, turn: float) -> tuple[Policy, np.ndarray]:
    boxes, observation = _box_at(distance, hardness)
    return OrientedBoxes(boxes.centre, boxes.log_width, boxes.log_hardness, [[turn], [-turn]]), observation


def _mirrored_at(potential: float) -> tuple[Policy, np.ndarray]:
    pool = Hyperplanes([[potential, 0.0]], [0.0])
    return Mirrored(pool, (1, 0), (-1, -1), (1,), (0,)), np.array([1.0, -2.0])


def _gated_at(potential: float, widths: float) -> tuple[Policy, np.ndarray]:
    return Gated(Hyperplanes([[potential]], [0.0]), [LocalGaussians([[1.0 - widths]], [[0.0]])]), np.array([1.0])


EXTREMES: dict[str, Callable[[], tuple[Policy, np.ndarray]]] = {
    **{f"motoneurons at {x}": lambda x=x: _motoneurons_at(x) for x in (-700.0, -50.0, 50.0, 700.0)},
    **{f"hyperplanes at {x}": lambda x=x: _hyperplanes_at(x) for x in (-700.0, -50.0, 50.0, 700.0)},
    **{f"softmax-2 at {x}": lambda x=x: _softmax_at(x, 2) for x in (-700.0, -50.0, 50.0, 700.0)},
    **{f"softmax-5 at {x}": lambda x=x: _softmax_at(x, 5) for x in (-700.0, -50.0, 50.0, 700.0)},
    **{f"gaussian {x} widths away": lambda x=x: _gaussians_at(x) for x in (0.0, 1e-4, 1.5e-3, 0.1, 40.0)},
    "gaussian at the centre, p_max = 0.5": lambda: _gaussians_at(0.0, 0.5),
    "gaussian 40 widths away, p_max = 0.5": lambda: _gaussians_at(40.0, 0.5),
    "free gaussian of too great a mass": lambda: _free_at(0.0, 5.0),
    "free gaussian 40 widths away": lambda: _free_at(40.0, 0.0),
    **{f"sphere, {x} from its centre": lambda x=x: _sphere_at(x) for x in (0.0, 1e-15, 1e-4, 700.0)},
    "hard sphere at its centre": lambda: _sphere_at(0.0, np.log(700.0)),
    **{f"box, {x} from its centre": lambda x=x: _box_at(x, 1.0) for x in (0.0, 1.0, 40.0)},
    "hard box at its centre": lambda: _box_at(0.0, np.log(700.0)),
    "hard box at its wall": lambda: _box_at(1.0, np.log(700.0)),
    "oriented gaussian at the centre": lambda: _oriented_at(0.0, 3.0),
    **{f"oriented gaussian, shear {x}, far away": lambda x=x: _oriented_at(40.0, x) for x in (-1.0, 1e3)},
    "oriented box at its centre": lambda: _turned_at(0.0, 1.0, 0.5),
    "oriented box, 40.0 from its centre": lambda: _turned_at(40.0, 1.0, -0.5),
    "hard oriented box at its wall": lambda: _turned_at(1.0, np.log(700.0), 0.0),
    **{f"oriented box, turn {x}": lambda x=x: _turned_at(0.3, 1.0, x) for x in (1e-8, 1e3)},
    **{f"mirrored hyperplanes at {x}": lambda x=x: _mirrored_at(x) for x in (-700.0, 50.0)},
    "gate surely open, capped below": lambda: _gated_at(50.0, 0.0),
    "gate surely closed, far below": lambda: _gated_at(-50.0, 40.0),
    "factored, saturated and capped": lambda: _mixed_at(700.0, 0.0),
    "factored, silent and far": lambda: _mixed_at(-50.0, 40.0),
    "admission thresholds at 700": lambda: (AdmissionThresholds([500.0, 0.0], 1.5), np.array([1.0, 0.0, 100 / 3])),
    "admission, no call asking": lambda: (AdmissionThresholds([500.0, 0.0], 1.5), np.array([0.0, 0.0, 7.0])),
}
"""Places where a careless formula overflows, divides by zero or cancels: a policy and the observation that brings it
there."""

EXTREME_REPRESENTATIVES = (
    "motoneurons at -700.0",
    "motoneurons at 700.0",
    "softmax-5 at -700.0",
    "softmax-5 at 700.0",
    "gaussian 0.0 widths away",
    "gaussian 0.0015 widths away",
    "gaussian 40.0 widths away",
    "free gaussian of too great a mass",
    "sphere, 1e-15 from its centre",
    "hard sphere at its centre",
    "box, 40.0 from its centre",
    "hard box at its wall",
    "oriented gaussian, shear 1000.0, far away",
    "oriented box, 40.0 from its centre",
    "oriented box, turn 1000.0",
)
"""The places that `make test` runs: both ends of each kind of unit. What is put together of them has parts that are
tried there."""
