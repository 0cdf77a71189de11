"""A page of a learner, paused, as a stranger finds it."""

import pytest

import motorgrad as mg


@pytest.fixture(scope="module")
def page():
    with mg.sim.view("chain", playing=False) as page:
        yield page
        assert page.failures == 0


@pytest.fixture
def quiet(caplog, capfd):
    """A function that returns the lines that the page's server has logged. In the end nothing else may be printed."""
    caplog.set_level("DEBUG", "motorgrad")

    def lines():
        return [record.getMessage() for record in caplog.records if record.name.startswith("motorgrad.sim.page")]

    yield lines
    assert [record for record in caplog.records if record.name == "asyncio" and record.levelno >= 40] == []
    assert all("\n" not in line and len(line) < 400 for line in lines())
    out, err = capfd.readouterr()
    assert "Traceback" not in out + err
