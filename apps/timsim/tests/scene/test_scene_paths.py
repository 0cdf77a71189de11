"""The tubes of muscles run where the physics engine has them."""

import mujoco
import numpy as np
import pytest
from scene_moments import walk

from timsim.scene import _muscles as _paths

PULLEY = """
<mujoco>
  <worldbody>
    <site name="a" pos="0 0 1"/><site name="b" pos="0.3 0 1"/><site name="c" pos="0.5 0 1"/>
    <body pos="0.2 0 0.5"><joint type="slide" axis="0 0 1"/><geom size="0.05"/><site name="d"/></body>
  </worldbody>
  <tendon>
    <spatial><site site="a"/><site site="d"/><pulley divisor="2"/><site site="b"/><site site="c"/></spatial>
  </tendon>
</mujoco>"""


def posed(model, position):
    data = mujoco.MjData(model)
    data.qpos[:] = position
    mujoco.mj_forward(model, data)
    return data


def engine_points(model, data, tendon):
    """The path of a tendon through one piece, as the engine has it."""
    rows = slice(data.ten_wrapadr[tendon], data.ten_wrapadr[tendon] + data.ten_wrapnum[tendon])
    return data.wrap_xpos.reshape(-1, 3)[rows], data.wrap_obj.reshape(-1)[rows]


@pytest.mark.parametrize("body", ["hopper", "hexapod"])
@pytest.mark.parametrize("seed", range(3))
def test_tubes_go_through_the_engines_own_points_and_are_as_long(request, body, seed):
    model = request.getfixturevalue(body)
    data = posed(model, walk(model, 150, seed)[0])
    run = _paths.segments(model, data)
    most, ends = _paths.most_segments(model)
    assert len(run.start) <= most
    assert run.last.sum() == ends
    for tendon in range(model.ntendon):
        mine = run.tendon == tendon
        path = np.concatenate([run.start[mine], run.end[mine][-1:]])
        np.testing.assert_array_equal(path[1:], run.end[mine])  # without a gap
        points, _ = engine_points(model, data, tendon)
        at = [int(np.flatnonzero((path == point).all(1))[0]) for point in points]  # exactly, bit for bit
        assert at == sorted(at)
        assert at[0] == 0
        assert at[-1] == len(path) - 1
        # a chord of an eighth of a half circle is 0.6 % shorter than its arc
        length = np.linalg.norm(np.diff(path, axis=0), axis=1).sum()
        assert length == pytest.approx(data.ten_length[tendon], rel=0.007)
        assert length <= data.ten_length[tendon] + 1e-9


def test_an_arc_lies_on_what_it_is_wrapped_around(hexapod):
    """Every point between two on a cylinder is as far from its axis as the cylinder is thick."""
    arcs = 0
    for seed in range(3):
        data = posed(hexapod, walk(hexapod, 120, seed)[0])
        run = _paths.segments(hexapod, data)
        for tendon in range(hexapod.ntendon):
            points, kinds = engine_points(hexapod, data, tendon)
            on = np.flatnonzero(kinds >= 0)
            if len(on) < 2:
                continue
            geom = kinds[on[0]]
            mine = run.start[run.tendon == tendon]
            first = int(np.flatnonzero((mine == points[on[0]]).all(1))[0])
            bow = mine[first : first + _paths.ARC + 1]
            axis = data.geom_xmat[geom].reshape(3, 3)[:, 2]
            out = bow - data.geom_xpos[geom]
            away = np.linalg.norm(out - np.outer(out @ axis, axis), axis=1)
            np.testing.assert_allclose(away, hexapod.geom_size[geom, 0], rtol=1e-6)
            arcs += 1
    assert arcs > 6


def test_a_pulley_cuts_the_path():
    model = mujoco.MjModel.from_xml_string(PULLEY)
    data = posed(model, [0.0])
    run = _paths.segments(model, data)
    np.testing.assert_allclose(run.start, [[0, 0, 1], [0.3, 0, 1]])
    np.testing.assert_allclose(run.end, [[0.2, 0, 0.5], [0.5, 0, 1]])
    np.testing.assert_array_equal(run.last, [True, True])


def test_a_model_without_tendons_has_no_path():
    model = mujoco.MjModel.from_xml_string("<mujoco><worldbody><body><geom size='1'/></body></worldbody></mujoco>")
    assert len(_paths.segments(model, posed(model, [])).start) == 0
