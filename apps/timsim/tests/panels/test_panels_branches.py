"""The folder of branches: what it tells, and what is pressed there."""

from pathlib import Path

import mujoco
import pytest
from panel_studio import studio

from patience import until
from timsim import live
from timsim.live import Branch, Session, Setup
from timsim.panels._branches import branch_list

LEG = Path(__file__).parents[1] / "leg.xml"


def test_the_list_tells_name_fork_length_and_edits():
    first = Branch("A", "", 0, 400, ((120, "rate: 1 → 2"),), False, True)
    second = Branch("<b>", "A", 60, 200, tuple((60 + i, f"push {i}") for i in range(6)), True, False)
    told = branch_list((first, second), 0.01)
    assert "A</b> · beside" in told
    assert "1.20 s: rate: 1 → 2" in told
    assert "&lt;b&gt;</b> · present" in told
    assert "from A at 0.60 s · to 2.0 s" in told
    assert "… 2 before" in told
    assert "push 5" in told
    assert "push 1<" not in told


class Press:
    """An event as a browser's press of a button in a group causes it."""

    client = None

    def __init__(self, value):
        self.target = self
        self.value = value


@pytest.fixture
def branching():
    model = mujoco.MjModel.from_xml_path(str(LEG))
    with Session(Setup("leg", model=model), playing=False) as session:
        session.order(live.Step(50))
        assert until(lambda: session.snapshot().decision == 50)
        with studio(session) as place:
            yield place.panels.panels["Run"], session


@pytest.mark.ci
def test_a_branch_is_forked_renamed_run_beside_gone_to_and_deleted(branching):
    panel, session = branching
    folder = panel._branches

    def press(button):
        panel.guarded(lambda event: folder._press(event.target.value))(Press(button))

    folder._name.value = "idea"
    press("Fork here")
    assert until(lambda: [branch.name for branch in session.branches] == ["A", "idea"])
    assert folder._name.value == ""
    folder.show()
    assert folder._which.options == ("A", "idea")
    assert folder._which.value == "A"
    press("Beside")
    assert until(lambda: session.snapshot().labels == ("idea", "A"))
    press("Beside")  # again: no longer
    assert until(lambda: len(session.snapshot().labels) == 1)
    folder._name.value = "before"
    press("Rename")
    assert until(lambda: session.branches[0].name == "before")
    folder.show()
    folder._which.value = "before"
    press("Go to")
    assert until(lambda: session.branches[0].present)
    folder.show()
    assert folder._which.value == "idea"
    press("Delete")
    assert until(lambda: [branch.name for branch in session.branches] == ["before"])
