"""What holds of every plain block of the registry: a new one is tested here without a line."""

import dataclasses
import inspect
import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from block_driver import of

import timlab
from motorgrad.schema import PART_CLASSES
from timlab import BLOCKS, Block, Moment, Sink, parameters_of, settings_of
from timlab.blocks.learning import PART_BLOCKS
from timlab.diagram import choices_of, function_problems

ELSEWHERE = ("timlab.blocks.learning", "timlab.blocks.worlds")  # these have tests of their own
PLAIN = [name for name, kind in BLOCKS.items() if not kind.__module__.startswith(ELSEWHERE)]


def made(name, tmp_path):
    if name == "data file":
        np.savez(tmp_path / "table.npz", y=np.arange(3.0))
        return of(name, str(tmp_path / "table.npz"))
    return of(name)


def variants(name, tmp_path):
    """The block as it is by default, and with every other choice of its settings."""
    first = made(name, tmp_path)
    yield first
    for field in settings_of(type(first)):
        for choice in choices_of(type(first), field):
            try:
                yield dataclasses.replace(first, **{field: choice})
            except ValueError:  # it needs another setting beside it
                continue
        if isinstance(getattr(first, field), bool):
            yield dataclasses.replace(first, **{field: not getattr(first, field)})


@pytest.mark.parametrize("name", PLAIN)
def test_is_declared_in_full(name):
    kind = BLOCKS[name]
    assert kind.name == name
    assert kind.category
    assert len(inspect.getdoc(kind) or "") > 20
    declared = {**parameters_of(kind), **settings_of(kind)}
    assert set(declared) == {field.name for field in dataclasses.fields(kind)}
    for field, part in declared.items():
        assert part.help, f"{name}.{field} has no help"
        assert part.help[0].islower() or part.help[0] in "$_" or part.help.startswith("RK4"), part.help
        assert not part.help.endswith(".")


@pytest.mark.parametrize("name", PLAIN)
def test_keeps_what_it_declares(name, tmp_path):
    for block in variants(name, tmp_path):
        assert list(function_problems(block)) == []


LATER = ("logic", "mathematics", "vectors")  # compute each number by itself


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=pytest.mark.ci if BLOCKS[n].category in LATER else ()) for n in PLAIN]
)
def test_gives_the_same_stacked_as_alone(name, tmp_path):
    block = made(name, tmp_path)
    if isinstance(block, Sink):
        pytest.skip("nothing of a sink is computed")
    rng = np.random.default_rng(0)
    values = {name: np.asarray(value) for name, value in block.values().items()}
    inputs = {name: rng.uniform(0.2, 0.9, port.shape).astype(port.dtype) for name, port in block.inputs.items()}
    time, step, numbers = np.float32(0.3), np.float32(0.1), rng.uniform(size=block.uniforms).astype(np.float32)
    now = Moment(np.uint32(3), time, step, numbers, time)

    def functions(block, inputs, now):
        state = block.init(jnp.full(block.init_uniforms, 0.5))
        direct = {name: u for name, u in inputs.items() if block.inputs[name].feedthrough}
        moved = block.derivative(state, inputs, now) if block.is_continuous else ()
        return block.output(state, direct, now), block.update(state, inputs, now), moved

    def bound(values, inputs, now):
        return functions(block.bound(values), inputs, now)

    twice = jax.tree.map(lambda leaf: np.stack([leaf, leaf]), (values, inputs, now))
    single, stacked = jax.jit(lambda one, two: (bound(*one), jax.vmap(bound)(*two)))((values, inputs, now), twice)
    for row in (0, 1):
        for one, other in zip(jax.tree.leaves(single), jax.tree.leaves(stacked), strict=True):
            np.testing.assert_allclose(one, other[row], rtol=1e-6, atol=1e-6)
    assert all(np.all(np.isfinite(leaf)) for leaf in jax.tree.leaves(single))


@pytest.mark.parametrize("name", PLAIN)
def test_refuses_parameters_out_of_range_by_name(name, tmp_path):
    block = made(name, tmp_path)
    for field, part in parameters_of(type(block)).items():
        for wrong in (
            float("nan"),
            float("inf"),
            "x",
            None,
            [[1.0], [1.0, 2.0]],
            part.range.low - 1,
            part.range.high + 1,
        ):
            with pytest.raises(ValueError, match=rf"^{field}\b"):
                dataclasses.replace(block, **{field: wrong})


@pytest.mark.parametrize("name", PLAIN)
def test_refuses_wrong_settings_in_one_line(name, tmp_path):
    block = made(name, tmp_path)
    wrongs = (None, True, "no such thing", "\n" * 2000, 1e30, -1, (), (("",),), ((1, 2), (3,)), object())
    for field, wrong in itertools.product(settings_of(type(block)), wrongs):
        message = ""
        try:
            dataclasses.replace(block, **{field: wrong})
        except ValueError as error:  # any other kind of exception fails the test
            message = str(error)
        assert "\n" not in message
        assert len(message) < 1000


def test_every_block_of_the_library_is_registered_and_exported():
    def below(kind):
        return {kind}.union(*map(below, kind.__subclasses__()))

    # tests register others, and take them back
    parts = {part for kinds in PART_CLASSES.values() for part in kinds.values()}
    library = {
        kind
        for kind in below(Block)
        if kind.__module__.startswith("timlab.") and "name" in vars(kind)
        if not hasattr(kind, "part") or kind.part in parts
        if not kind.__module__.startswith("timlab.fmi.")  # made for a unit, not for diagrams
    }
    assert library == {kind for kind in BLOCKS.values() if kind.__module__.startswith("timlab.")}
    assert all(getattr(timlab, kind.__name__) is kind for kind in library)
    assert {kind.__name__ for kind in library - set(PART_BLOCKS.values())} <= set(timlab.__all__)
