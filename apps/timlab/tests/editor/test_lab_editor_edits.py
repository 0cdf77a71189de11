"""Changes of a diagram: what they do, that clients hear all of it, and that all can be taken back."""

import json

import pytest
from editor_clients import patch
from hypothesis import given, settings
from hypothesis import strategies as st

import timlab
from timlab import gallery
from timlab.compiler import plan
from timlab.diagram import blocks_of
from timlab.editor import _masks as _masks  # its operations
from timlab.editor._document import Document
from timlab.editor._edits import SetParameter, selection
from timlab.editor._protocol import operation_from
from timlab.editor._views import difference, view

KINDS = ["add", "add", "add", "connect", "connect", "remove", "rename", "set", "head", "move", "group", "ungroup", "x"]
KINDS += ["declare", "use", "undeclare"]
TYPES = ["gain", "sum", "integrator", "scope", "inlet", "outlet", "constant", "diagram", "mean baseline"]


def plain(value):
    """As a client has it."""
    return json.loads(json.dumps(value))


def operation(op, **fields):
    """An operation as it comes over the wire."""
    return operation_from({"op": op, **plain(fields)})


def edited(diagram, change):
    """A diagram after a change."""
    return change.apply(diagram)


def paths(diagram, at=()):
    """All diagrams in a diagram, with where they are."""
    yield list(at), diagram
    for name, node in diagram.nodes.items():
        if isinstance(node.block, timlab.Diagram):
            yield from paths(node.block, (*at, name))


@st.composite
def drawn(draw, diagram):
    """Some change of a diagram, which may be refused."""
    at, scope = draw(st.sampled_from(list(paths(diagram))))
    names = list(scope.nodes)
    outputs = [f"{n}.{p}" for n, node in scope.nodes.items() for p in node.block.outputs]
    inputs = [f"{n}.{p}" for n, node in scope.nodes.items() for p in node.block.inputs]
    some = st.lists(st.sampled_from(names), min_size=1, max_size=3) if names else st.just(["nothing"])
    one = st.sampled_from(names) if names else st.just("nothing")
    point = st.tuples(st.integers(-500, 500), st.integers(-500, 500))
    kind = draw(st.sampled_from(KINDS))
    match kind:
        case "add":
            return operation("add", at=at, type=draw(st.sampled_from(TYPES)), position=draw(st.none() | point))
        case "connect" if outputs and inputs:
            ends = {"source": draw(st.sampled_from(outputs)), "target": draw(st.sampled_from(inputs))}
            return operation("connect", at=at, **ends)
        case "remove":
            return operation("remove", at=at, names=draw(some))
        case "rename":
            return operation("rename", at=at, name=draw(one), to=draw(st.sampled_from(["a", "b", "u", "y", *names])))
        case "set":
            return operation("set", at=at, name=draw(one), field="every", value=draw(st.integers(0, 3)))
        case "head":
            return operation("set", at=at, field="title", value=draw(st.text(max_size=3)))
        case "move":
            return operation("move", at=at, positions={draw(one): draw(point)})
        case "group":
            return operation("group", at=at, names=draw(some))
        case "ungroup":
            return operation("ungroup", at=at, name=draw(one))
        case "declare" | "undeclare":
            return operation(kind, at=at, parameter=draw(st.sampled_from("pq")))
        case "use":
            field, parameter = draw(st.sampled_from(["gain", "value", "p"])), draw(st.none() | st.sampled_from("pq"))
            return operation("use", at=at, name=draw(one), field=field, parameter=parameter)
    chosen = [name for name in draw(some) if name in scope.nodes]
    if draw(st.booleans()) and chosen:
        return operation("paste", at=at, fragment=selection(diagram, at, chosen), position=draw(point))
    return operation("comment", at=at, text=draw(st.text(max_size=3)), box=[0, 0, 10, 10])


@pytest.mark.ci
@settings(max_examples=150, deadline=None)
@given(st.data())
def test_undo_all_is_the_document_before_and_clients_see_every_step(data):
    first = timlab.Diagram()
    document, seen, versions = Document(first.copy()), plain(view(first)), [first.copy()]
    for _ in range(data.draw(st.integers(1, 12))):
        before, change = document.diagram, data.draw(drawn(document.diagram))
        kept = before.copy()
        try:
            document.update(edited(before, change))
        except ValueError:
            assert document.diagram is before
            continue
        finally:
            assert before == kept  # nothing that was is altered
        versions.append(document.diagram.copy())
        for scope in difference(before, document.diagram):
            patch(seen, plain(scope))
        assert seen == plain(view(document.diagram))
        assert timlab.loads(timlab.dumps(document.diagram)) == document.diagram  # and it is a sound diagram
        assert set(document.diagram.wires) == set(timlab.loads(timlab.dumps(document.diagram)).wires)
    for version in reversed(versions):
        assert document.diagram == version
        if version is not versions[0]:
            document.undo()
    with pytest.raises(ValueError, match="after a change"):
        document.undo()
    for version in versions[1:]:
        document.redo()
        assert document.diagram == version


@settings(max_examples=8, deadline=None)
@given(st.sampled_from(["chain", "motoneuron-pool"]), st.data())
@pytest.mark.ci
def test_a_group_and_its_undoing_change_no_number(name, data):
    diagram = gallery.example(name)
    chosen = data.draw(st.lists(st.sampled_from(list(diagram.nodes)), min_size=1, unique=True))
    grouped = edited(diagram, operation("group", at=[], names=chosen))
    streams = {placed.identity: placed.stream for placed in plan(diagram).blocks}
    assert {placed.identity: placed.stream for placed in plan(grouped).blocks} == streams
    apart = edited(grouped, operation("ungroup", at=[], name="subsystem"))
    assert dict(sorted(apart.nodes.items())) == dict(sorted(diagram.nodes.items()))
    assert apart.wires == diagram.wires


@pytest.mark.ci
def test_a_group_in_motion_gives_the_same_numbers():
    diagram = gallery.example("motoneuron-pool")
    grouped = edited(diagram, operation("group", at=[], names=["force", "payoff", "reward", "baseline"], name="world"))
    one, other = timlab.Run(diagram).advance(300), timlab.Run(grouped).advance(300)
    assert set(one.signals) == set(other.signals)
    assert all((one[address] == other[address]).all() for address in one.signals)


def test_ports_of_a_subsystem_keep_their_wires_when_they_are_renamed_and_lose_them_when_they_go():
    diagram = edited(gallery.example("motoneuron-pool"), operation("group", at=[], names=["force"], name="muscle"))
    inner = diagram.nodes["muscle"].block
    (port,) = inner.inputs
    renamed = edited(diagram, operation("rename", at=["muscle"], name=port, to="drive"))
    assert ("muscle", "drive") in renamed.wires
    assert len(renamed.wires) == len(diagram.wires)
    gone = edited(renamed, operation("remove", at=["muscle"], names=["drive"]))
    assert not any(target[0] == "muscle" for target in gone.wires)


def test_pasted_blocks_are_new_ones_with_their_own_chance():
    diagram = gallery.example("chain")
    fragment = selection(diagram, [], ["policy", "trace"])
    twice = edited(edited(diagram, operation("paste", at=[], fragment=fragment, position=[5, 5])), operation(
        "paste", at=[], fragment=fragment))  # fmt: skip
    assert {"policy 2", "trace 2", "policy 3", "trace 3"} <= set(twice.nodes)
    ids = [node.id for node in twice.nodes.values()]
    assert len(set(ids)) == len(ids)
    assert twice.wires["trace 2", "score"] == ("policy 2", "score")


def test_parameters_and_single_units_by_address():
    diagram = gallery.example("motoneuron-pool")
    assert blocks_of(SetParameter("payoff.numbers", [1.0, 0.0]).apply(diagram))["payoff"].numbers == (1.0, 0.0)
    one = edited(diagram, operation("freeze", address="policy", on=True, unit=2))
    assert blocks_of(one)["policy"].frozen == (False, False, True, False)
    both = edited(one, operation("freeze", address="policy", on=True, unit=0))
    assert blocks_of(edited(both, operation("freeze", address="policy", on=False, unit=2)))["policy"].frozen == (
        (True, False, False, False)
    )
    assert blocks_of(edited(diagram, operation("freeze", address="optimizer", on=True)))["optimizer"].frozen is True
    for wrong, message in [
        ({"address": "load", "on": True}, "load.*must be a block that learns"),
        ({"address": "policy", "on": True, "unit": 4}, "unit = 4: must be an integer from 0 to 3"),
        ({"address": "optimizer", "on": True, "unit": 0}, "must be null|0 … 0|as one"),
    ]:
        with pytest.raises(ValueError, match=message):
            edited(diagram, operation("freeze", **wrong))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"op": "add", "at": [], "type": "gian"}, "did you mean 'gain'"),
        ({"op": "add", "at": ["nowhere"], "type": "gain"}, "unknown subsystem 'nowhere'"),
        ({"op": "add", "at": [], "type": "data file"}, "data file: path must be given"),
        ({"op": "add", "at": [], "type": "gain", "fields": {"gian": 1}}, "did you mean 'gain'"),
        ({"op": "add", "at": [], "type": "gain", "fields": {"gain": "much"}}, "gain = 'much': must be a finite number"),
        ({"op": "add", "at": [], "type": "gain", "position": [1]}, "add.position = .*: must be a list"),
        ({"op": "add", "type": "gain"}, "add.at: must be given"),
        ({"op": "remove", "at": [], "names": ["wrld"]}, "did you mean 'world'"),
        ({"op": "rename", "at": [], "name": "world", "to": "policy"}, "must be a new name"),
        ({"op": "rename", "at": [], "name": "world", "to": "a/b"}, "without '.' and '/'"),
        (
            {"op": "set", "at": [], "name": "optimizer", "field": "learning_rate", "value": -1},
            "learning_rate = -1.0: must be a finite number of at least 0",
        ),
        ({"op": "set", "at": [], "field": "tick", "value": 0}, "tick = 0: must be a positive"),
        (
            {"op": "set", "at": [], "name": "optimizer", "field": "learning_rat", "value": 1},
            "did you mean 'learning_rate'",
        ),
        ({"op": "connect", "at": [], "source": "policy.score", "target": "baseline.reward"}, "accepts one float"),
        ({"op": "disconnect", "at": [], "target": "world.reward"}, "unknown input of world"),
        ({"op": "move", "at": [], "positions": {"nothing": [0, 0]}}, "unknown block 'nothing'"),
        ({"op": "ungroup", "at": [], "name": "world"}, "must be a subsystem"),
        ({"op": "group", "at": [], "names": []}, "at least one"),
        ({"op": "comment", "at": [], "text": "x"}, "box = None: must be x, y, width"),
        ({"op": "paste", "at": [], "fragment": {"format": "other"}}, "format = 'other'"),
        ({"op": "hop", "at": []}, "unknown op 'hop'"),
        ({"op": "tick", "n": 1.5}, "tick.n = 1.5: must be an integer"),
        ({"op": "undo", "much": 1}, "unknown setting of undo 'much'"),
    ],
)
def test_what_cannot_be_is_refused_by_name(change, message):
    diagram = gallery.example("chain")
    with pytest.raises(ValueError, match=message):
        edited(diagram, operation_from(change))
    assert diagram == gallery.example("chain")
