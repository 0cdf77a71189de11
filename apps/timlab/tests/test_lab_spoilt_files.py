"""Spoilt files give a diagram or a refusal on one line: never a hang, a crash, or code that runs."""

import copy
import json
import random
import sys
import time

import pytest

from timlab import BLOCKS, Diagram, dumps, example, loads, problems

LONGEST = 1_000  # characters of a refusal
SLOWEST = 5.0  # seconds of the processor for one file
RUNS = {"exec", "compile", "import", "os.system", "os.exec", "subprocess.Popen", "marshal.loads"}
NUMBERS = [True, -1, 0, 1, 2**31, 1e30, 1e-30, 0.5]
ODD = [*NUMBERS, None, "", "x", "gain", "a.b", "../x", [], [[]], [1, 2], [[1, 2], [3]], {}, {"a": 1}]


class Watch:
    """What Python was asked to run while it was on; an audit hook cannot be taken away, so it is turned off."""

    def __init__(self):
        self.on, self.seen = False, []
        sys.addaudithook(self._heard)

    def _heard(self, event, arguments):
        if self.on and event in RUNS:
            self.seen.append((event, arguments))


def every_kind() -> dict:
    """A file with a block of every type that needs nothing, some wires, a subsystem, and a layout."""
    inner, outer = Diagram(), Diagram(title="all")
    for diagram in (inner, outer):
        for kind in BLOCKS.values():
            try:
                diagram.add(kind.name, kind())
            except (TypeError, ValueError):
                continue
    outer.add("sub", inner)
    for source, target in (("constant", "gain"), ("gain", "integrator"), ("integrator", "sum.u1")):
        outer.connect(source, target)
    outer.layout = {"at": {"gain": [1, 2]}}
    return json.loads(dumps(outer))


def places(data, found):
    """Every table and list in the data, with a name or number in it."""
    entries = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    for key, value in list(entries):
        found.append((data, key))
        places(value, found)
    return found


def spoilt(text: str, chance: random.Random) -> str:
    """The text with something in it changed: a value, a name, or some characters."""
    way = chance.randrange(4)
    if way == 0:
        letters = list(text)
        for _ in range(chance.randint(1, 4)):
            letters[chance.randrange(len(letters))] = chance.choice('{}[]",:0123456789.-eE aNnul\\\n')
        return "".join(letters)
    if way == 1:
        start = chance.randrange(len(text))
        return text[:start] + text[start + chance.randint(1, 200) :]
    data = json.loads(text)
    for _ in range(chance.randint(1, 3)):
        table, key = chance.choice(places(data, []))
        if way == 2 or not isinstance(table, dict):
            table[key] = copy.deepcopy(chance.choice(ODD))
        else:
            table[chance.choice([*table, "new", "type", "id"])] = table.pop(key)
    return json.dumps(data, allow_nan=True)


@pytest.fixture(scope="module")
def small() -> list[str]:
    """Files of a few blocks each, so that a change meets every one of them."""
    whole = every_kind()
    named = [name for name in whole["blocks"] if name != "sub"]
    some = [named[start : start + 4] for start in range(0, len(named), 4)]
    files = [json.dumps({**whole, "blocks": {n: whole["blocks"][n] for n in each}, "wires": {}}) for each in some]
    inner = {n: whole["blocks"]["sub"]["blocks"][n] for n in ("gain", "inlet", "outlet")}
    blocks = {n: whole["blocks"][n] for n in ("constant", "gain", "integrator", "sum")}
    blocks["sub"] = {
        "type": "diagram",
        "id": "sub",
        "blocks": inner,
        "wires": {"gain.u": "inlet.y", "outlet.u": "gain.y"},
    }
    return [*files, json.dumps({**whole, "blocks": blocks})]


@pytest.mark.parametrize(
    "count", [150, pytest.param(300, marks=pytest.mark.ci), pytest.param(10_000, marks=pytest.mark.slow)]
)
def test_a_spoilt_file_is_loaded_or_refused_on_one_line_and_runs_no_code(count, small):
    for text in small:
        problems(loads(text))  # what is imported when first used is so now
    watch, chance, refused = Watch(), random.Random(count), 0
    for number in range(count):
        text = spoilt(small[number % len(small)], chance)
        start = time.process_time()
        try:
            watch.on = True
            diagram = loads(text)
        except ValueError as error:
            said, diagram = str(error), None
            refused += 1
            assert said, text
            assert len(said.splitlines()) == 1, (said, text)
            assert len(said) < LONGEST, (said, text)
        finally:
            watch.on = False
        assert time.process_time() - start < SLOWEST, text
        if diagram is not None:
            assert loads(dumps(diagram)) == diagram
    assert watch.seen == []
    assert count / 10 < refused < count


def test_a_policy_of_many_inputs_is_laid_out_in_no_time():
    text = dumps(example("particle"))
    start = time.process_time()
    loads(text.replace('"observed": 2', '"observed": 10000'))
    assert time.process_time() - start < SLOWEST


ENDLESS = {
    "a name twice": ("1, ".join(f'"{n}": ' for n in range(30_000)) + '1, "29999": 1', "must occur once"),
    "a long name": (f'"{"k" * 10**6}": [{"0, " * 50_000}0]', "format"),
}


@pytest.mark.parametrize("kind", ENDLESS)
def test_names_are_looked_at_once(kind):
    inside, said = ENDLESS[kind]
    start = time.process_time()
    with pytest.raises(ValueError, match=said):
        loads(f"{{{inside}}}")
    assert time.process_time() - start < SLOWEST


@pytest.mark.parametrize(
    "block", [{"type": "constant", "shape": [2**23]}, {"type": "constant", "shape": [1000, 1000, 9]}]
)
def test_a_few_lines_do_not_take_gigabytes(block):
    end = {"type": "outlet", "shape": block["shape"]}
    data = json.loads(dumps(Diagram())) | {"blocks": {"huge": block, "end": end}, "wires": {"end.u": "huge"}}
    (problem,) = problems(loads(json.dumps(data)))
    assert problem.path == "huge"
    assert "numbers in the ports of the diagram: must be at most 4,194,304" in problem.message


def test_ticks_beyond_all_numbers_are_no_whole_number():
    data = json.loads(dumps(Diagram())) | {"tick": 1e-300, "blocks": {"c": {"type": "constant", "period": 3e38}}}
    (problem,) = problems(loads(json.dumps(data)))
    assert "must be a whole number of ticks" in problem.message


@pytest.mark.parametrize("way", ["tags", "subsystems"])
def test_a_signal_passes_so_many_tags_and_subsystems(way):
    """A longer way ended in a `RecursionError`, which no page showed."""
    count, blocks, wires = 300, {"source": {"type": "constant"}, "end": {"type": "outlet"}}, {}
    inner = {"blocks": {"in": {"type": "inlet"}, "out": {"type": "outlet"}}, "wires": {"out.u": "in"}}
    last = "source"
    for number in map(str, range(count)):
        if way == "tags":
            blocks |= {
                f"to {number}": {"type": "goto", "tag": number},
                f"from {number}": {"type": "from", "tag": number},
            }
            wires[f"to {number}.u"], last = last, f"from {number}"
        else:
            blocks[number] = {"type": "diagram", **inner}
            wires[f"{number}.in"], last = last, f"{number}.out"
    data = json.loads(dumps(Diagram())) | {"blocks": blocks, "wires": wires | {"end.u": last}}
    found = problems(loads(json.dumps(data)))
    assert "the signal passes more than 200 subsystems and tags" in found[0].message


@pytest.mark.parametrize(("kind", "signs"), [("sum", "+-"), ("product", "*/")])
def test_a_string_of_signs_is_no_longer_than_there_may_be_ports(kind, signs):
    data = json.loads(dumps(Diagram())) | {"blocks": {"all": {"type": kind, "signs": signs * 10**6}}}
    with pytest.raises(ValueError, match=r"all: signs = .* at most 1000"):
        loads(json.dumps(data))
