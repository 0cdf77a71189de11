"""The body drawn on matplotlib axes."""

import mujoco
import numpy as np
import pytest
from matplotlib.figure import Figure

from timsim import draw

POSE = np.array([0.1, -0.05, 0.5, -0.9])


@pytest.fixture
def ax():
    return Figure().add_subplot()


@pytest.mark.parametrize(("azimuth", "right"), [(90, [1, 0, 0]), (180, [0, 1, 0]), (-90, [-1, 0, 0])])
def test_muscles_run_where_mujoco_says(ax, leg, azimuth, right):
    drawing = draw(ax, leg, POSE, np.zeros(4), azimuth=azimuth)
    data = mujoco.MjData(leg)
    data.qpos[:] = POSE
    mujoco.mj_forward(leg, data)
    lines = drawing.muscles.get_segments()
    assert len(lines) == leg.ntendon == 4
    assert max(len(line) for line in lines) == 4  # one at least is wrapped over the knee
    for tendon, line in enumerate(lines):
        first = data.ten_wrapadr[tendon]
        points = data.wrap_xpos.reshape(-1, 3)[first : first + data.ten_wrapnum[tendon]]
        np.testing.assert_allclose(line, np.stack([points @ right, points[:, 2]], 1), atol=1e-12)


def test_firing_muscles_are_red_and_wide(ax, leg):
    drawing = draw(ax, leg, POSE, np.array([0, 0, 1, 0]))
    colours, widths = drawing.muscles.get_colors(), drawing.muscles.get_linewidths()
    assert colours[2, 0] - colours[2, 1] > 0.7
    assert colours[0, 0] - colours[0, 1] < 0.3
    assert widths[2] > 1.9 * widths[0]
    drawing.update(POSE, np.array([1, 0, 0, 0]))
    assert drawing.muscles.get_linewidths()[0] > drawing.muscles.get_linewidths()[2]


def test_tendons_without_a_muscle_are_grey(ax):
    xml = """<mujoco><worldbody><site name="a"/><body pos="0 0 1"><joint/><geom size=".1"/><site name="b"/></body>
    </worldbody><tendon><spatial><site site="a"/><site site="b"/></spatial></tendon></mujoco>"""
    drawing = draw(ax, mujoco.MjModel.from_xml_string(xml), np.zeros(1), np.zeros(0))
    assert np.ptp(drawing.muscles.get_colors()[0, :3]) < 0.1


@pytest.mark.parametrize(
    ("geom", "extent"),
    [
        ('type="sphere" size=".1"', (0.1, 0.1)),
        ('type="capsule" size=".1 .3"', (0.1, 0.4)),
        ('type="cylinder" size=".1 .3"', (0.1, 0.3)),
        ('type="ellipsoid" size=".1 .2 .3"', (0.1, 0.3)),
        ('type="box" size=".1 .2 .3"', (0.1, 0.3)),
        ('type="box" size=".1 .2 .3" euler="0 0 90"', (0.2, 0.3)),
        ('type="capsule" size=".1 .3" euler="0 90 0"', (0.4, 0.1)),
        ('type="capsule" size=".1 .3" euler="90 0 0"', (0.1, 0.1)),
        ('type="mesh" mesh="m"', (0.5, 0.5)),
    ],
)
def test_outlines_have_the_shapes_size(ax, geom, extent):
    corners = " ".join(f"{x} {y} {z}" for x in (-0.5, 0.5) for y in (-0.2, 0.2) for z in (-0.5, 0.5))
    xml = f"""<mujoco><asset><mesh name="m" vertex="{corners}"/></asset><worldbody><body pos="1 2 3"><joint/>
    <geom {geom}/></body></worldbody></mujoco>"""
    drawing = draw(ax, mujoco.MjModel.from_xml_string(xml), np.zeros(1), np.zeros(0))
    np.testing.assert_allclose(drawing.bounds().mean(0), [1, 3], atol=2e-3)
    np.testing.assert_allclose(np.diff(drawing.bounds(), axis=0)[0] / 2, extent, rtol=0.005)


def test_the_ground_is_a_line_where_the_field_is(ax):
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><asset><hfield name="h" nrow="3" ncol="5" size="2 1 .5 .1"/></asset><worldbody>
        <geom type="hfield" hfield="h" pos="0 0 .1"/><body pos="0 0 1"><joint/><geom size=".1"/></body>
        </worldbody></mujoco>"""
    )
    model.hfield_data[:] = np.tile([0, 0.5, 1, 0.5, 0], 3)
    drawing = draw(ax, model, np.zeros(1), np.zeros(0))
    surface = drawing._ground.get_paths()[0].vertices
    for x, z in ((-1, 0.35), (0, 0.6), (0.5, 0.475)):
        assert np.interp(x, surface[:-3, 0], surface[:-3, 1]) == pytest.approx(z, abs=0.01)


def test_limits_hold_the_body(ax, leg):
    draw(ax, leg, POSE, np.zeros(4))
    ax.apply_aspect()
    low, high = np.array([ax.get_xlim(), ax.get_ylim()]).T
    bounds = draw(Figure().add_subplot(), leg, POSE, np.zeros(4)).bounds()
    assert np.all(low < bounds[0])
    assert np.all(high > bounds[1])
    assert np.all(high - low < 5)  # the ground, which has no end, does not count


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"position": np.zeros(3)}, r"position.shape = \(3,\)"),
        ({"activation": np.zeros(3)}, r"activation.shape = \(3,\)"),
        ({"alpha": 0}, "alpha = 0"),
        ({"linewidth": -1}, "linewidth = -1"),
        ({"azimuth": np.nan}, "azimuth = nan"),
        ({"elevation": 91}, "elevation = 91"),
    ],
)
def test_bad_input_is_refused(ax, leg, change, message):
    with pytest.raises(ValueError, match=message):
        draw(ax, leg, **{"position": POSE, "activation": np.zeros(4), **change})
