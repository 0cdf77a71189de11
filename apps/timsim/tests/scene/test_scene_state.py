"""What is drawn, as viser's server has it; without a browser."""

from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np
import pytest
from scene_moments import moment, standing, walk

from motorgrad.bodies import Hexapod, Hopper, OnTerrain, Terrain, compile_model
from motorgrad.tasks import Composed
from timsim.film import FIRING, SILENT, ground_height
from timsim.live._numbers import editable_numbers, write_numbers
from timsim.live._snapshot import Sizes
from timsim.scene import Pose
from timsim.scene._annotations import Ghost, Trail
from timsim.scene._beside import Labels, Readings
from timsim.scene._bodies import Bodies, Targets
from timsim.scene._contacts import Balance, touches
from timsim.scene._muscles import Muscles, peak_force, tendon_tension
from timsim.scene._surroundings import height_field_glb


def layer_of(scene, kind):
    return next(layer for layer in scene.layers if isinstance(layer, kind))


def as_light(srgb):
    return np.round(255 * np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4))


def test_muscles_change_colour_and_thickness_when_they_fire(hopper, staged):
    scene, pose = staged(hopper)
    start = hopper.key_qpos[0]
    tubes, _ = layer_of(scene, Muscles).pools
    shown = []
    for decision, level in enumerate((0.0, 0.5, 1.0)):
        snapshot = moment(start, control=level, decision=decision, model=hopper)
        pose.place(snapshot)
        scene.update(snapshot, pose)
        real = tubes.handle.batched_scales[:, 2] > 1e-5
        colour, thick = tubes.handle.batched_colors[real], tubes.handle.batched_scales[real, 0]
        shown.append((colour, thick))
    for colour, expected in zip((shown[0][0], shown[2][0]), (SILENT, FIRING), strict=True):
        np.testing.assert_array_equal(colour, np.tile(as_light(expected), (len(colour), 1)))
    assert np.all(shown[2][1] > shown[1][1])
    assert np.all(shown[1][1] > shown[0][1])
    np.testing.assert_allclose(shown[0][1], shown[0][1][0])  # no force, all as thin


def test_one_muscle_of_many_fires(hexapod, staged):
    scene, pose = staged(hexapod)
    control = np.zeros(hexapod.nu)
    control[5] = 1.0
    snapshot = moment(hexapod.key_qpos[0], control=control, model=hexapod)
    pose.place(snapshot)
    scene.update(snapshot, pose)
    handle = layer_of(scene, Muscles).pools[0].handle
    red = (handle.batched_colors == as_light(FIRING)).all(1) & (handle.batched_scales[:, 2] > 1e-5)
    ends = pose.bodies[0].site_xpos[
        [hexapod.site(f"{hexapod.actuator(5).name}_{end}").id for end in ("origin", "insertion")]
    ]
    middle = handle.batched_positions[red]
    np.testing.assert_allclose(middle.mean(0), ends.mean(0), atol=1e-6)


def test_nothing_is_added_or_made_again_as_a_body_moves(hexapod, staged):
    """viser's client makes a batched mesh again, and meanwhile leaves it out, for another opacity or shape."""
    scene, pose = staged(hexapod)
    handles = kept = None
    for decision in range(12):
        position, velocity, control = walk(hexapod, 40 * decision, decision)
        snapshot = moment(position, velocity=velocity, control=control, decision=decision, model=hexapod)
        pose.place(snapshot)
        scene.update(snapshot, pose)
        now = [pool.handle for layer in scene.layers for pool in layer.pools]
        assert handles is None or all(a is b for a, b in zip(handles, now, strict=True))
        handles = now
        shapes = [(h.batched_opacities, h.opacity, h.vertices, h.faces, h.material, h.side, h.lod) for h in now]
        assert kept is None or all(a is b for a, b in zip(sum(kept, ()), sum(shapes, ()), strict=True))
        kept = shapes


def test_targets_stand_beside_each_body(hopper, server):
    sizes = Sizes(*(0,) * 10, marks=8)
    session: Any = SimpleNamespace(model=hopper, task=Composed(), sizes=sizes)
    layer, pose = Targets(), Pose(hopper)
    layer.build(server, session)
    marks = [(0.1, 0.2, 0.3, 0.05), (0.4, 0.5, 0.6, 0.02)]
    pose.place(moment(np.stack([hopper.key_qpos[0]] * 2), marks=marks, model=hopper))
    layer.draw(pose)
    handle = layer.pools[0].handle
    expected = np.concatenate([np.array(marks)[:, :3] + offset for offset in pose.offset])
    np.testing.assert_allclose(handle.batched_positions, expected, atol=1e-6)
    np.testing.assert_allclose(handle.batched_scales[:, 0], [0.05, 0.02] * 2)
    assert (handle.batched_opacities < 1).all()


def test_geoms_are_where_the_engine_has_them(hexapod, staged):
    scene, pose = staged(hexapod)
    position, velocity, control = walk(hexapod, 200)
    snapshot = moment(position, velocity=velocity, control=control, model=hexapod)
    pose.place(snapshot)
    scene.update(snapshot, pose)
    data = mujoco.MjData(hexapod)
    data.qpos[:] = position
    mujoco.mj_forward(hexapod, data)
    blocks = next(pool for pool in layer_of(scene, Bodies).pools if pool.handle.name == "/bodies/blocks")
    boxes = np.flatnonzero(hexapod.geom_type == mujoco.mjtGeom.mjGEOM_BOX)
    np.testing.assert_allclose(blocks.handle.batched_positions[: len(boxes)], data.geom_xpos[boxes], atol=1e-6)
    np.testing.assert_allclose(blocks.handle.batched_scales[: len(boxes)], hexapod.geom_size[boxes], atol=1e-6)
    quaternion = np.empty(4)
    for row, box in enumerate(boxes):
        mujoco.mju_mat2Quat(quaternion, data.geom_xmat[box])
        assert abs(blocks.handle.batched_wxyzs[row] @ quaternion) == pytest.approx(1.0, abs=1e-6)


def test_two_bodies_stand_side_by_side_and_one_is_left(hexapod, staged):
    scene, pose = staged(hexapod)
    start = hexapod.key_qpos[0]
    for decision, count in enumerate((1, 2, 1)):
        snapshot = moment(np.tile(start, (count, 1)), decision=decision, model=hexapod)
        pose.place(snapshot)
        scene.update(snapshot, pose)
        blocks = next(pool for pool in layer_of(scene, Bodies).pools if pool.handle.name == "/bodies/blocks").handle
        there = blocks.batched_positions[blocks.batched_scales[:, 0] > 1e-5]
        assert len(there) == 3 * count
        assert (scene._server.scene.get_handle_by_name("/labels/1") is not None) == (count == 2)
    np.testing.assert_allclose(pose.offset, [[0, 0, 0]])
    pose.place(moment(np.tile(start, (2, 1)), model=hexapod))
    assert pose.offset[1, 1] > 0.75  # wider than the body


def test_a_state_that_is_not_finite_leaves_the_body_where_it_was(hopper):
    pose = Pose(hopper)
    pose.place(moment(hopper.key_qpos[0], model=hopper))
    before = pose.bodies[0].xpos.copy()
    pose.place(moment(np.full(hopper.nq, np.nan), model=hopper))
    np.testing.assert_array_equal(pose.bodies[0].xpos, before)


def test_contacts_carry_the_weight(hexapod):
    pose = Pose(hexapod)
    position, velocity, control = standing(hexapod)
    pose.place(moment(position, velocity=velocity, control=control, model=hexapod))
    touch = touches(hexapod, pose.bodies[0])
    weight = hexapod.body_mass.sum() * 9.81
    assert touch.ground.all()
    np.testing.assert_allclose(touch.point[:, 2], 0.0, atol=1e-9)  # on the floor, not in it
    np.testing.assert_allclose(touch.force.sum(0), [0, 0, weight], atol=0.05 * weight)


def test_a_standing_hexapod_is_over_its_feet_and_a_lifted_one_has_no_polygon(hexapod, staged):
    scene, pose = staged(hexapod)
    position, velocity, control = standing(hexapod)
    layer = layer_of(scene, Balance)
    for decision, lift in enumerate((0.0, 1.0)):
        position[2] += lift
        snapshot = moment(position, velocity=velocity, control=control, decision=decision, model=hexapod)
        pose.place(snapshot)
        scene.update(snapshot, pose)
        fill = layer._fills[0]
        assert fill.visible == (lift == 0)
        mass = layer.pools[0].handle.batched_positions[0]
        np.testing.assert_allclose(mass, pose.bodies[0].subtree_com[0], atol=1e-6)


def test_a_layer_that_is_off_is_hidden_and_costs_nothing(hexapod, staged):
    scene, pose = staged(hexapod)
    muscles = layer_of(scene, Muscles)
    start = hexapod.key_qpos[0]
    snapshot = moment(start, model=hexapod)
    pose.place(snapshot)
    scene.update(snapshot, pose)
    muscles.shown = False
    handle = muscles.pools[0].handle
    before = handle.batched_positions.copy()
    assert not handle.visible
    later = moment(start + 0.1, decision=1, model=hexapod)
    pose.place(later)
    scene.update(later, pose)
    np.testing.assert_array_equal(handle.batched_positions, before)
    muscles.shown = True
    scene.update(later, pose)
    assert handle.visible
    assert not np.array_equal(handle.batched_positions, before)


def test_tension_is_a_share_of_the_strength(hopper):
    peak = peak_force(hopper)
    np.testing.assert_allclose(peak, np.abs(hopper.actuator_gainprm[:, 0]))
    np.testing.assert_allclose(tendon_tension(hopper, -0.25 * peak), 0.25)
    np.testing.assert_allclose(tendon_tension(hopper, peak), 0.0)  # a muscle does not push


@pytest.mark.parametrize("kind", ["waves", "map"])
def test_hills_are_those_of_the_field(kind, tmp_path):
    import trimesh

    np.save(tmp_path / "hills.npy", np.eye(7))
    ground = {"map": tmp_path / "hills.npy"} if kind == "map" else {"kind": kind}
    model = compile_model(OnTerrain(Hexapod(), Terrain(**ground, height=0.4, size=(4.0, 3.0))))
    field = int(np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_HFIELD)[0])
    content = height_field_glb(model, model.geom_dataid[field], np.array([0.7, 0.7, 0.6]))
    (mesh,) = trimesh.load(trimesh.util.wrap_as_stream(content), file_type="glb").geometry.values()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    places = mesh.vertices + data.geom_xpos[field]
    heights = ground_height(model, data, places)
    assert heights is not None
    inside = np.all(np.abs(mesh.vertices[:, :2]) < model.hfield_size[0, :2] - 1e-6, axis=1)
    np.testing.assert_allclose(places[inside, 2], heights[inside], atol=1e-5)
    assert np.ptp(places[:, 2]) > 0.1


def test_edited_sizes_and_the_chosen_part_are_drawn_although_the_run_stands_still(staged, server):
    model = compile_model(Hopper())  # of its own, as it is edited
    scene, pose = staged(model)
    snapshot = moment(model.key_qpos[0], model=model)
    load = model.body("load").id

    def drawn():
        pose.place(snapshot)
        scene.update(snapshot, pose)
        balls = server.scene.get_handle_by_name("/bodies/balls")
        return np.array(balls.batched_scales), np.array(balls.batched_colors)

    sizes, colours = drawn()
    (pieces,) = [geoms for handle, geoms in scene.draggable() if handle.name == "/bodies/balls"]
    of_load = np.flatnonzero(model.geom_bodyid[pieces] == load)
    numbers = editable_numbers(model)
    values = {name: number.get(model) for name, number in numbers.items()}
    write_numbers(model, numbers, values | {"body.load.radius": 0.2})
    grown, _ = drawn()
    np.testing.assert_allclose(grown[of_load], 0.2)
    scene.choose(load)
    _, tinted = drawn()
    changed = np.flatnonzero(np.any(tinted != colours, axis=1))
    assert changed.tolist() == of_load.tolist()
    scene.choose(-1)
    write_numbers(model, numbers, values)
    for now, before in zip(drawn(), (sizes, colours), strict=True):
        np.testing.assert_array_equal(now, before)


def test_a_ghost_is_of_half_a_second_ago_or_there_is_none(hexapod, staged):
    scene, pose = staged(hexapod, [Ghost()])

    def ahead(decision, resets=0):
        """How far the body is ahead of its ghost, in m; None without one. It goes by a metre a second."""
        position = hexapod.key_qpos[0].copy()
        position[0] += decision / 50
        snapshot = moment(position, decision=decision, model=hexapod)._replace(reset_count=resets)
        pose.place(snapshot)
        scene.update(snapshot, pose)
        pool, pieces = next(part for part in scene.layers[0]._parts if part[0].handle.name == "/ghost/blocks")
        if pool.handle.batched_scales.max() < 1e-5:
            return None
        return float(np.mean(pose.bodies[0].geom_xpos[pieces.geom] - pool.handle.batched_positions, axis=0)[0])

    assert [ahead(decision) for decision in range(40)][25:] == pytest.approx([0.5] * 15, abs=1e-5)
    assert ahead(200, resets=1) is None  # it went there at once
    assert [ahead(decision, resets=1) for decision in range(201, 240)][24:] == pytest.approx([0.5] * 15, abs=1e-5)
    assert [ahead(decision, resets=1) for decision in range(300, 600, 50)] == [None] * 6  # too fast


def test_a_trail_gets_thinner_with_age(hexapod, staged):
    scene, pose = staged(hexapod, [Trail()])
    for decision in range(60):
        position = hexapod.key_qpos[0].copy()
        position[0] += decision / 50
        snapshot = moment(position, decision=decision, model=hexapod)
        pose.place(snapshot)
        scene.update(snapshot, pose)
    handle = scene.layers[0].pools[0].handle
    real = handle.batched_scales[:, 2] > 1e-5
    assert (np.diff(handle.batched_scales[real, 0]) > 0).all()  # the oldest first
    assert np.ptp(handle.batched_positions[real, 0]) > 0.9


def test_a_label_is_of_the_moment_at_which_the_run_is_paused(hexapod):
    session: Any = SimpleNamespace(model=hexapod, agent=None)
    readings, labels, pose = Readings(session), Labels(), Pose(hexapod)

    def words(decision, speed, playing):
        position = hexapod.key_qpos[0].copy()
        position[0] += speed * decision / 50
        pose.place(moment(position, decision=decision, model=hexapod)._replace(playing=playing))
        return readings.words(pose)

    words(0, 1.0, True)
    words(50, 1.0, True)
    before = labels.renew(pose)
    assert words(50, 1.0, False) == ["1.00 m/s"]
    assert labels.renew(pose) != before  # so that it is drawn once more
    assert words(100, 2.0, False) == ["2.00 m/s"]  # a single step, at once
