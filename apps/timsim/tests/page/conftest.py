"""A page of a learner, paused, as a stranger finds it."""

import pytest

import timsim
from motorgrad.pages import _gate

_pages = []


@pytest.fixture(autouse=True)
def _left(messages_to_who_has_left):
    pass


@pytest.fixture
def page(messages_to_who_has_left):
    """One for all tests of this folder, as its process takes seconds to start. It is left paused."""
    if not _pages:
        from page_clients import PLACES  # which needs what a page does

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(_gate, "STRANGERS", PLACES)
            _pages.append(timsim.view("chain", playing=False))
    yield _pages[0]
    assert _pages[0].failures == 0


@pytest.hookimpl(trylast=True)  # after those of fixtures
def pytest_runtest_teardown(item, nextitem):
    if _pages and (nextitem is None or nextitem.path.parent != item.path.parent):
        _pages.pop().close()


@pytest.fixture
def quiet(caplog, capfd):
    """A function that returns the lines that the page's server has logged. In the end nothing else may be printed."""
    caplog.set_level("DEBUG", "motorgrad")

    def lines():
        return [record.getMessage() for record in caplog.records if record.name.startswith("timsim.page")]

    yield lines
    assert [record for record in caplog.records if record.name == "asyncio" and record.levelno >= 40] == []
    assert all("\n" not in line and len(line) < 400 for line in lines())
    out, err = capfd.readouterr()
    assert "Traceback" not in out + err
