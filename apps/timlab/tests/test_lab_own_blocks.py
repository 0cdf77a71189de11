"""Blocks of a user's own: classes in a file, and Python functions in a diagram."""

import json
import pickle
import sys

import numpy as np
import pytest

import timlab
from motorgrad._errors import NotTrusted
from motorgrad.cli import main
from timlab import Diagram, DiagramError, Interpreter, PythonFunction, Run
from timlab.diagram import _foreign
from timlab.editor import Session

OWN = """
import timlab

@timlab.block
class TwiceAsMuch(timlab.Block):
    inputs = {"u": timlab.Port()}
    outputs = {"y": timlab.Port()}

    def output(self, state, inputs, now):
        return {"y": 2 * inputs["u"]}
"""


@pytest.fixture
def own_file(tmp_path, monkeypatch):
    """A file with a block, which is forgotten after the test."""
    file = tmp_path / "blocks_of_mine.py"
    file.write_text(OWN)
    monkeypatch.setattr(sys, "path", list(sys.path))
    yield file
    sys.modules.pop("blocks_of_mine", None)
    timlab.BLOCKS.maps[0].pop("twice as much", None)


def test_a_file_of_blocks_is_imported_and_saved_diagrams_load_again(own_file, tmp_path, capsys):
    with pytest.raises(SystemExit, match="0"):
        main(["lab", "--import", str(own_file), "--check"])
    diagram = Diagram()
    diagram.add("one", timlab.Constant(1.5))
    diagram.add("twice", timlab.BLOCKS["twice as much"]())
    diagram.connect("one", "twice")
    timlab.save(diagram, tmp_path / "mine.json")
    assert timlab.load(tmp_path / "mine.json") == diagram
    assert timlab.dumps(timlab.load(tmp_path / "mine.json")) == timlab.dumps(diagram)
    assert Run(diagram, watch=["twice.y"]).advance(1)["twice.y"] == 3.0
    assert timlab.BLOCKS["twice as much"].category == "mathematics"
    del timlab.BLOCKS["twice as much"]
    with pytest.raises(ValueError, match=r"twice: the type of block 'twice as much' is defined in 'blocks_of_mine'"):
        timlab.load(tmp_path / "mine.json")


def test_only_blocks_with_names_of_their_own_are_registered(capsys):
    with pytest.raises(ValueError, match=r"must be a class under timlab.Block"):
        timlab.block(dict)
    with pytest.raises(ValueError, match=r"name = 'gain': must be a name that no other type has"):
        timlab.block(type("Gain", (timlab.Block,), {}))
    assert main(["--import", "nowhere.py", "list"]) == 2
    assert "cannot import 'nowhere.py': there is no such file" in capsys.readouterr().err


def accumulator(source=None):
    diagram = Diagram(tick=0.5)
    diagram.add("noise", timlab.UniformNoise())
    diagram.add("f", PythonFunction(*([] if source is None else [source])))
    diagram.connect("noise", "f.u")
    return diagram


WATCHED = ("f.y", "noise.y")


def test_a_python_function_has_a_memory_that_goes_back_in_time():
    run = Run(accumulator(), seeds=2, watch=WATCHED)
    record = run.advance(5)
    np.testing.assert_allclose(record["f.y"], np.cumsum(record["noise.y"], axis=1), rtol=1e-6)
    state = run.state
    first = run.advance(4)["f.y"]
    run.restore(state)
    np.testing.assert_array_equal(run.advance(4)["f.y"], first)
    np.testing.assert_array_equal(Interpreter(accumulator(), watch=WATCHED).advance(5)["f.y"][0], record["f.y"][0])


def test_several_inputs_and_outputs_with_shapes():
    source = "def step(a, b, memory, time):\n    return a * b, np.array([time, a.sum()])\n"
    diagram = Diagram(tick=0.5)
    diagram.add("a", timlab.Constant([1.0, 2.0, 4.0], shape=(3,)))
    diagram.add("b", timlab.Constant(3.0))
    shapes = {"takes_shapes": ((3,), ()), "gives_shapes": ((3,), (2,))}
    diagram.add("f", PythonFunction(source, takes=("a", "b"), gives=("p", "q"), **shapes))
    diagram.connect("a", "f.a")
    diagram.connect("b", "f.b")
    record = Run(diagram, watch=["f.p", "f.q"]).advance(2)
    assert record["f.p"][0, 1].tolist() == [3, 6, 12]
    assert record["f.q"][0, 1].tolist() == [0.5, 7]


STRANGE = "__import__('os').makedirs('ran', exist_ok=True)\ndef step(u, memory, time): return u  # a stranger's\n"


def test_a_strangers_function_is_shown_and_not_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    quoted = STRANGE.replace("\n", "\\n").replace('"', '\\"')
    text = timlab.dumps(accumulator("def step(u, memory, time): return u\n"))
    text = text.replace("def step(u, memory, time): return u\\n", quoted)
    opened = timlab.loads(text)
    assert opened.nodes["f"].block.source == STRANGE
    # nor under another setting, nor in a copy, nor when it is started by hand
    opened.replace("f", opened.nodes["f"].block.retuned({"every": 2}))
    with pytest.raises(DiagramError, match=r"f: the diagram brings code of its own, \"__import__.*--trust"):
        Run(opened.copy())
    with pytest.raises(NotTrusted):
        opened.nodes["f"].block.start(np.zeros(1, int), np.zeros((1, 0)))
    (tmp_path / "strange.json").write_text(text)
    session = Session(file=tmp_path / "strange.json", states=tmp_path / "states")
    (told,) = session._offers.of(session.diagram)
    assert (told["path"], told["code"], told["offered"]) == ("f", STRANGE, True)  # the page shows it, and asks
    session.close()
    assert not (tmp_path / "ran").exists()
    Run(timlab.load(tmp_path / "strange.json", trust=True)).advance(1)
    assert (tmp_path / "ran").exists()
    Run(timlab.loads(text)).advance(1)  # the same code, trusted before


PLAIN = "def step(u, memory, time): return u  # of one kind or another\n"


def test_code_that_is_not_trusted_is_not_trusted_where_it_is_sent(monkeypatch):
    function = PythonFunction(PLAIN)
    with _foreign.from_a_file(trust=False):
        doubted = PythonFunction(PLAIN + "# and more\n")
    sent = pickle.dumps((function, doubted))
    for name in ("_trusted", "_refused"):  # as in another process
        monkeypatch.setattr(_foreign, name, set())
    theirs, still = pickle.loads(sent)
    assert (theirs, still) == (function, doubted)
    assert theirs.is_trusted
    assert not still.is_trusted
    monkeypatch.setattr(_foreign, "_refused", set())
    assert not still.is_trusted  # only what is trusted runs, not all that nobody refused


def test_code_of_one_kind_is_not_that_of_another():
    class Other(PythonFunction):
        name = "other"

    assert Other(PLAIN).key != PythonFunction(PLAIN).key


def test_the_page_lets_code_run_that_a_file_brought_and_no_other(tmp_path):
    session = Session(Diagram(), folder=tmp_path, states=tmp_path / "states")
    numbers = iter(range(100))

    def ask(**operation):
        answers = []
        session.handle(json.dumps(operation | {"client": "page", "sequence": next(numbers)}), answers.append)
        return answers[-1]["event"]

    def offers():
        return [(each["key"], each["offered"]) for each in session._offers.of(session.diagram)]

    text = timlab.dumps(accumulator("def step(u, memory, time): return u\n"))
    theirs, typed = (text.replace("return u", f"return {number} * u") for number in (2, 3))
    (tmp_path / "theirs.json").write_text(theirs)
    for _ in range(2):  # text that is dropped, then the file that the page made of it
        assert ask(op="open", text=typed) == "done"
        ((key, offered),) = offers()
        assert not offered
        assert ask(op="trust", keys=[key]) == "refused"
        assert ask(op="save", file="typed", over=True) == "done"
        assert ask(op="open", file="typed.json") == "done"
    assert ask(op="open", file="theirs.json") == "done"
    ((key, offered),) = offers()
    assert offered
    assert ask(op="trust", keys=[key]) == "done"
    assert (offers(), session.diagram.nodes["f"].block.is_trusted) == ([], True)
    session.close()


def test_a_function_that_the_page_writes_runs_only_where_the_page_is_trusted(tmp_path):
    def written(source, trust):
        session = Session(accumulator(), states=tmp_path / "states", trust=trust)
        sent = {"op": "set", "at": [], "name": "f", "fields": {}, "field": "source", "value": source}
        answers = []
        session.handle(json.dumps(sent | {"client": "page", "sequence": 1}), answers.append)
        assert [answer["event"] for answer in answers] == ["done"], answers
        block = session.diagram.nodes["f"].block
        session.close()
        assert block.source == source
        return block.is_trusted

    source = accumulator().nodes["f"].block.source
    assert not written(source + "# from the page", trust=False)
    assert written(source + "# from a page that is trusted", trust=True)


@pytest.mark.parametrize(
    ("source", "error", "message"),
    [
        ("def step(u:\n", ValueError, "source: line 1: "),
        ("x = 1\n", ValueError, "must be Python with a function step"),
        ("def step(u, memory, time):\n    return 1 / 0\n", RuntimeError, "python function, line 2: ZeroDivisionError"),
        ("def step(u, memory, time):\n    return [u, u]\n", ValueError, r"must be numbers of shape \(\)"),
    ],
)
def test_mistakes_are_named(source, error, message):
    with pytest.raises(error, match=message):
        Run(accumulator(source)).advance(1)
