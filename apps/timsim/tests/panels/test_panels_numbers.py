"""Numbers as tables and as words."""

import csv
import io
import itertools

import mujoco
import numpy as np
import pytest

from motorgrad.schema import descriptions
from motorgrad.tasks import Hopper, make
from motorgrad.training import agent_for
from timsim.panels._charts import SIZE, fitting_ticks, smoothed, tick_label
from timsim.panels._panel import brief, columns_of, csv_of, table
from timsim.panels._parts import part_facts, world_facts
from timsim.panels._settings_form import number_of, words_of


def test_a_table_can_be_read_back():
    rows = np.array([[0.1, np.nan], [2.5e-7, 3.0]])
    columns = {"decision": np.array([7, 8]), **columns_of("level, in %", ["a", "b"], rows)}
    found = list(csv.DictReader(io.StringIO(csv_of(columns).decode())))
    assert [row["decision"] for row in found] == ["7", "8"]
    assert float(found[0]["level, in % a"]) == 0.1
    assert float(found[1]["level, in % a"]) == 2.5e-7
    assert found[0]["level, in % b"] == ""
    text = csv_of({"seconds": np.float32([52.66]), "metres": np.array([52.660000000000004]), "far": np.array([1e300])})
    assert text == b"seconds,metres,far\n52.66,52.66,1e+300\n"


@pytest.mark.parametrize("limits", [(0.0751, 0.1012), (-0.00123, 0.00456), (61_000.0, 62_900.0), (0.0, 1.0)])
def test_the_texts_of_ticks_do_not_overlap(limits):
    for room in (90.0, 120.0, 290.0):
        ends = []
        for value in fitting_ticks(*limits, room):
            middle, half = (value - limits[0]) / (limits[1] - limits[0]) * room, 0.28 * SIZE * len(tick_label(value))
            ends.append((middle - half, middle + half))
        assert ends
        assert all(left[1] < right[0] for left, right in itertools.pairwise(ends))


def test_columns_of_different_lengths_are_refused():
    with pytest.raises(ValueError, match="zip"):
        csv_of({"a": np.zeros(2), "b": np.zeros(3)})


@pytest.mark.parametrize(
    ("value", "said"),
    [
        (0, "0"),
        (-2e-13, "0"),
        (1234.5678, "1,235"),
        (0.012345, "0.0123"),
        (-2.5, "−2.50"),
        (3.2e-7, "3.20e−07"),
        (8.8e9, "8.80e+09"),
        (float("nan"), "–"),
        (float("inf"), "∞"),
        (9.999, "10.00"),
    ],
)
def test_numbers_for_people(value, said):
    assert brief(value) == said


def test_words_from_models_are_text_and_not_markup():
    assert "<script>" not in table([("<script>", "<b>")])
    assert "&lt;script&gt;" in table([("<script>", "1")])


def test_running_means_are_of_what_is_there():
    values = np.arange(101.0)
    np.testing.assert_allclose(smoothed(values)[2:-2], values[2:-2])
    assert smoothed(np.array([1.0, 5.0]))[0] == 3.0
    assert smoothed(np.zeros(0)).size == 0


@pytest.mark.parametrize("text", ["", "fast", "1,5", "0x10", "5e"])
def test_what_is_no_number_is_refused_by_name(text):
    with pytest.raises(ValueError, match="learning rate") as refused:
        number_of("learning rate", text)
    assert "\n" not in str(refused.value)


def test_settings_have_words():
    agent = agent_for("particle")
    assert words_of("agent.estimator.trace.decay", None, agent)[0] == "trace decay"
    assert "per decision" in words_of("agent.estimator.trace.decay", None, agent)[1]
    assert words_of("body.flexor_left.damping")[0] == "damping (N·s/m)"
    assert words_of("agent.optimizer.learning_rate.log_width", None, agent)[0] == "learning rate log width"
    label, hint = words_of("task.hop_height", make("hopper"))
    assert (label, hint[:10]) == ("hop height (m)", descriptions(Hopper)["hop_height"][:10])


LOADED = """
<mujoco>
  <worldbody>
    <geom name="floor" type="plane" size="5 5 .1"/>
    <body name="box" pos="0 0 .1">
      <freejoint name="free"/>
      <geom name="box" type="box" size=".2 .1 .1" mass="2"/>
      <body name="flap" pos="0 0 .2"><joint name="hinge" axis="0 1 0" range="-90 45"/>
        <geom size=".05" mass=".5"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


def test_a_part_is_told_with_units_and_the_force_of_its_contacts():
    model = mujoco.MjModel.from_xml_string(LOADED)
    data = mujoco.MjData(model)
    for _ in range(2000):
        mujoco.mj_step(model, data)
    data.qpos[7] = np.radians(30)
    data.qvel[6] = np.radians(-12)
    facts = dict(part_facts(model, data, model.body("box").id))
    assert facts["mass"] == "2.00 kg, 80% of the body"
    assert facts["shape"] == "box, 400 × 200 × 200 mm"
    assert facts["contact force"] == "24.5 N in 4 contacts"  # the weight of both
    assert facts["free"] == "free"
    flap = dict(part_facts(model, data, model.body("flap").id))
    assert flap["hinge"] == "30.0° (−90.0° to 45.0°), −12.0°/s"
    assert flap["contact force"] == "none"
    assert dict(world_facts(model, data))["weight of the body"] == "24.5 N"
