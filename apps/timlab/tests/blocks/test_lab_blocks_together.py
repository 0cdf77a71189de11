"""Plain blocks with other settings than by default, in one diagram: compiled, it does what the interpreter does."""

import numpy as np
import pytest
from block_driver import of
from test_lab_blocks_registry import PLAIN, variants

from timlab import Diagram, Interpreter, Outlet, Port, Run, dumps, loads

TICKS = 5


def feed(diagram, number, port):
    """A block that gives changing signals of a port's shape and kind; another for another number."""
    name = f"{port.kind} {port.shape} {number}"
    if name in diagram.nodes:
        return name
    if port.kind == "float":
        return diagram.add(name, of("uniform noise", 0.1, 0.9, shape=port.shape, every=2))
    wider = {"bool": "float", "int": "bool"}[port.kind]
    source = feed(diagram, number, Port(port.shape, wider))
    condition = of("expression", "u > 0.5", shape=port.shape)
    diagram.add(name, condition if port.kind == "bool" else of("counter", shape=port.shape))
    diagram.connect(source, f"{name}.u")
    return name


def together(blocks):
    """A diagram of these blocks by name, each fed by noise, with an outlet at each of their outputs."""
    diagram = Diagram(0.05)
    for name, block in blocks.items():
        diagram.add(name, block)
        for number, (input_, port) in enumerate(block.inputs.items()):
            diagram.connect(feed(diagram, number, port), f"{name}.{input_}")
        for number, (output, port) in enumerate(block.outputs.items()):
            outlet = diagram.add(f"{name} out {number}", Outlet(port.shape, port.kind))
            diagram.connect(f"{name}.{output}", f"{outlet}.u")
    return diagram


@pytest.fixture(scope="module")
def diagram(tmp_path_factory):
    folder = tmp_path_factory.mktemp("data")
    blocks = {}
    for name in PLAIN:
        for number, block in enumerate(variants(name, folder)):
            # as they are by default, `test_lab_engine_differential.py` has them; choices of one function are alike
            if 0 < number <= 5:
                blocks[f"{name} {number}"] = block
    return together(blocks)


@pytest.mark.slow
def test_compiled_is_as_interpreted(diagram):
    compiled, interpreted = Run(diagram, [7]).advance(TICKS), Interpreter(diagram, 7).advance(TICKS)
    assert set(compiled.signals) == set(interpreted.signals)
    for address in compiled.signals:
        np.testing.assert_allclose(compiled[address], interpreted[address], rtol=2e-5, atol=2e-5, err_msg=address)


def test_a_file_of_all_blocks_is_the_same_diagram(diagram):
    assert loads(dumps(diagram)) == diagram
