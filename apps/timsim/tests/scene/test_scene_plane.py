"""The plane of a particle, of a real run."""

import types

import numpy as np
import pytest

from motorgrad.worlds import Walls
from patience import until
from timsim.live import Session, Step, setup_of
from timsim.scene import Pose, Scene, View
from timsim.scene._abstract import LiftedArm, MotoneuronPool, States
from timsim.scene._plane import BALL, Board, Plane, PlaneUnits
from timsim.scene._surroundings import Sky


def test_a_board_keeps_proportions_and_stands_on_the_floor():
    board = Board(Walls(left=-1.0, right=3.0, bottom=0.0, top=2.0))
    corners = board.place(np.array([(-1, 0), (3, 0), (3, 2)]))
    assert np.linalg.norm(corners[1] - corners[0]) == pytest.approx(1.0)
    assert np.linalg.norm(corners[2] - corners[1]) == pytest.approx(0.5)
    np.testing.assert_allclose(corners[:, 1], 0.0)
    assert corners[0, 2] > 0
    np.testing.assert_allclose(corners[0, 0], -corners[1, 0])


@pytest.mark.slow
def test_the_particle_is_where_it_is_and_its_units_light_up_as_they_fire(server):
    with Session(setup_of("particle"), playing=False) as session:
        scene, pose = Scene(), Pose(session.model)
        scene.build(server, session)
        plane = next(layer for layer in scene.layers if isinstance(layer, Plane))
        units = next(layer for layer in scene.layers if isinstance(layer, PlaneUnits))
        for _ in range(3):
            before = session.snapshot().decision
            session.order(Step(4))
            assert until(lambda before=before: session.snapshot().decision == before + 4)
            snapshot = session.snapshot()
            pose.place(snapshot)
            scene.update(snapshot, pose)
        board = Board(session.task.physics.walls)
        ball, trail = (pool.handle for pool in plane.pools)
        np.testing.assert_allclose(ball.batched_positions[0], board.place(snapshot.position[:, :2], BALL)[0], atol=1e-6)
        assert (trail.batched_scales[:, 2] > 1e-4).sum() == 2
        discs = units.pools[1].handle
        assert len(discs.batched_opacities) >= len(session.actions)
        order = np.argsort(discs.batched_opacities[: len(session.actions)])
        assert np.all(np.diff(snapshot.probability[0][order]) >= -1e-6)
        policy = session.policy(snapshot)
        # the policy is looked at four times a second, and learns meanwhile
        centre = board.place(np.asarray(policy.centre)[:1, :2])[0]
        np.testing.assert_allclose(discs.batched_positions[0, [0, 2]], centre[[0, 2]], atol=1e-3)


def drawn(scene, task, **known):
    """A scene's layers of one kind after a task's moment was shown."""
    setup = setup_of(task)
    scene.build(known.pop("server"), setup)
    pose = Pose(setup.model)
    snapshot = types.SimpleNamespace(decision=1, reset_count=0, **known)
    pose.place(snapshot)
    scene.update(snapshot, pose)
    return [pool.handle for layer in scene.layers for pool in layer.pools]


def test_a_chain_shows_its_states_and_where_it_is(server):
    scene = Scene([Sky(), States()])
    (balls,) = drawn(scene, "chain", server=server, position=np.array([[2.0]]))
    assert scene.draws
    assert np.argmax(balls.batched_scales[:, 0]) == 2
    assert np.all(np.diff(balls.batched_positions[:, 0]) > 0)  # in a row


def test_recruitment_shows_its_pool_and_which_units_are_likely_to_fire(server):
    known = {
        "position": np.array([[0.5]]),
        "probability": np.array([[0, 0.2, 0.6, 1]]),
    }
    scene = Scene([Sky(), MotoneuronPool(), LiftedArm()])
    units, balls, *_ = drawn(scene, "arm-recruitment", server=server, **known)
    assert np.all(np.diff(units.batched_colors[:, 1].astype(int)) < 0)  # redder and redder
    assert units.batched_positions[:, 0].min() > balls.batched_positions[:, 0].max()  # the arm is beside its pool

    heights, sizes = [], []
    for load in (2.0, 12.0):
        known["position"] = np.array([[load]])
        _, balls, *_ = drawn(Scene([Sky(), MotoneuronPool(), LiftedArm()]), "arm-recruitment", server=server, **known)
        heights.append(balls.batched_positions[0, 2])  # of the load, the only sphere
        sizes.append(balls.batched_scales[0, 0])
    assert heights[0] > heights[1] + 0.05  # 45 % of the pool lift 12 kg less far than 2 kg
    assert sizes[1] / sizes[0] == pytest.approx(6 ** (1 / 3), rel=1e-3)


def test_a_task_without_a_picture_says_so_and_offers_no_cameras(server):
    scene = Scene([Sky()])
    drawn(scene, "chain", server=server, position=np.zeros((1, 1)))
    assert not scene.draws
    view = View(scene)
    with server.gui.add_tab_group().add_tab("View"):
        view.build(server, setup_of("chain"))
    assert view.cameras.names == []
