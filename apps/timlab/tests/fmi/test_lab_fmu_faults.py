"""A unit ends with an error, and names the block, where a number is not finite."""

import numpy as np
import pytest
from units import needs_compiler

from timlab import Diagram, Expression, Integrator, Outlet, write_fmu

pytestmark = [needs_compiler, pytest.mark.needs("motorgrad[fmi]")]


def square(**settings) -> Diagram:
    """x' = x² from 2, which ends at 0.5 s."""
    diagram = Diagram(0.05, **settings)
    for name, block in {"x": Integrator(2.0), "q": Expression("x^2", ("x",)), "y": Outlet()}.items():
        diagram.add(name, block)
    for source, target in (("x", "q.x"), ("q", "x"), ("x", "y")):
        diagram.connect(source, target)
    return diagram


def simulated(path, told, **settings):
    import fmpy

    return fmpy.simulate_fmu(
        str(path), stop_time=1.0, output_interval=0.05, logger=lambda *given: told.append(given), **settings
    )


@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_a_unit_that_is_not_finite_ends_with_an_error(version, tmp_path):
    from fmpy.fmi1 import FMICallException

    told = []
    with pytest.raises(FMICallException):
        simulated(write_fmu(square(), tmp_path / "square.fmu", version), told)
    assert any(b"x: its state is not finite (at 0." in part for given in told for part in given if type(part) is bytes)


@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_a_unit_that_goes_on_knowingly_is_told_of_once(version, tmp_path):
    told = []
    found = simulated(write_fmu(square(on_fault="warn"), tmp_path / "square.fmu", version), told)
    assert not np.isfinite(found["y"][-1])
    assert sum(b"its state" in part for given in told for part in given if type(part) is bytes) == 1
