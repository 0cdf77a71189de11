"""Meshes with and without textures, and shapes of every kind."""

import mujoco
import numpy as np
import pytest
from scene_moments import moment

from timsim.film import geom_colours
from timsim.scene._bodies import Meshes

SHAPES = """
<mujoco>
  <asset>
    <mesh name="wedge" vertex="0 0 0  .2 0 0  0 .2 0  0 0 .2"/>
    <mesh name="painted" vertex="0 0 0  .2 0 0  0 .2 0  0 0 .2" face="0 2 1  0 1 3  0 3 2  1 2 3"
          texcoord="0 0  1 0  0 1  1 1"/>
    <texture name="paint" type="2d" builtin="flat" rgb1="1 .5 0" width="8" height="8"/>
    <material name="paint" texture="paint"/>
    <material name="glass" rgba=".2 .4 .9 .5"/>
  </asset>
  <worldbody>
    <geom type="plane" size="2 2 .1" rgba=".5 .6 .5 1"/>
    <body pos="0 0 .5">
      <freejoint/>
      <geom type="mesh" mesh="wedge" rgba=".3 .3 .8 1"/>
      <geom type="mesh" mesh="painted" material="paint" pos=".3 0 0"/>
      <geom type="ellipsoid" size=".1 .05 .08" pos="-.3 0 0" material="glass"/>
      <geom type="capsule" size=".03 .1" pos="0 .3 0"/>
      <geom type="cylinder" size=".05 .02" pos="0 -.3 0" group="4"/>
    </body>
  </worldbody>
</mujoco>"""


@pytest.fixture(scope="module")
def shapes():
    return mujoco.MjModel.from_xml_string(SHAPES)


def test_a_mesh_moves_with_its_part_and_is_sent_once(shapes, staged, server):
    scene, pose = staged(shapes)
    turned = np.array([0.4, -0.2, 0.9, np.cos(0.3), 0, 0, np.sin(0.3)])
    for decision, position in enumerate((shapes.qpos0, turned)):
        snapshot = moment(position, decision=decision, model=shapes)
        pose.place(snapshot)
        scene.update(snapshot, pose)
    frame = server.scene.get_handle_by_name("/meshes/0/1")
    np.testing.assert_allclose(frame.position, turned[:3])
    np.testing.assert_allclose(frame.wxyz, turned[3:], atol=1e-9)
    plain, painted = (server.scene.get_handle_by_name(f"/meshes/0/1/{geom}") for geom in (1, 2))
    assert hasattr(painted, "glb_data")
    # MuJoCo puts a mesh's frame where its inertia is; drawn, its corners are where they were
    corners = plain.vertices @ turn_of(shapes.geom_quat[1]).T + shapes.geom_pos[1]
    wanted = np.array([(0, 0, 0), (0.2, 0, 0), (0, 0.2, 0), (0, 0, 0.2)])
    for corner in wanted:
        assert np.linalg.norm(corners - corner, axis=1).min() < 1e-6
    meshes = next(layer for layer in scene.layers if isinstance(layer, Meshes))
    assert len(meshes._frames) == 1


def turn_of(quaternion):
    matrix = np.empty(9)
    mujoco.mju_quat2Mat(matrix, quaternion)
    return matrix.reshape(3, 3)


def test_colours_are_of_geom_material_and_texture(shapes):
    colours = geom_colours(shapes)
    np.testing.assert_allclose(colours[1], [0.3, 0.3, 0.8, 1], atol=1e-6)
    np.testing.assert_allclose(colours[2], [1, 0.5, 0, 1], atol=0.01)
    np.testing.assert_allclose(colours[3], [0.2, 0.4, 0.9, 0.5], atol=1e-6)


def test_what_one_sees_through_has_an_opacity_and_hidden_groups_are_not_drawn(shapes, staged, server):
    scene, pose = staged(shapes)
    snapshot = moment(shapes.qpos0, model=shapes)
    pose.place(snapshot)
    scene.update(snapshot, pose)
    glass = server.scene.get_handle_by_name("/bodies/balls/clear")
    assert glass.batched_opacities[0] == pytest.approx(0.5)
    np.testing.assert_allclose(glass.batched_scales[0], [0.1, 0.05, 0.08], rtol=1e-6)
    rods = server.scene.get_handle_by_name("/bodies/rods")
    assert len(rods.batched_positions) == 1  # the capsule's; the cylinder is of a hidden group
    np.testing.assert_allclose(rods.batched_scales[0], [0.03, 0.03, 0.2], rtol=1e-6)


def test_a_mesh_can_be_clicked_and_is_tinted_with_its_part(shapes, staged, server):
    scene, pose = staged(shapes)
    snapshot = moment(shapes.qpos0, model=shapes)
    pose.place(snapshot)
    scene.update(snapshot, pose)
    plain, painted = (server.scene.get_handle_by_name(f"/meshes/0/1/{geom}") for geom in (1, 2))
    found = {id(handle): geoms.tolist() for handle, geoms in scene.draggable()}
    assert (found[id(plain)], found[id(painted)]) == ([1], [2])
    colour = plain.color
    scene.choose(1)
    scene.update(snapshot, pose)
    assert plain.color != colour
    scene.choose(-1)
    scene.update(snapshot, pose)
    assert plain.color == colour
