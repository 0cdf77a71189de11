"""Stored motions and activations: read by names, played by the run, and refused with what is wrong."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from timsim import read_activations, read_motion
from timsim.live import Drive, DriveRecorded, Setup, setup_of
from timsim.live._bare_model import BareModel
from timsim.live._motion_player import MotionPlayer

LEG = Path(__file__).parents[1] / "leg.xml"
TIED = """<mujoco><worldbody><body><joint name="hinge" axis="0 1 0"/><geom size=".1"/>
<body><joint name="slide" type="slide"/><geom size=".1"/></body></body></worldbody>
<equality><joint joint1="slide" joint2="hinge" polycoef=".01 .02 .03 0 0"/></equality></mujoco>"""


@pytest.fixture
def leg() -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_path(str(LEG))


@pytest.fixture
def walk(tmp_path, leg) -> Path:
    """A second of the leg as OpenSim writes it, in degrees, with a muscle's activation."""
    names = [leg.joint(i).name for i in range(leg.njnt)]
    lines = ["walk", "version=1", "nRows=101", "inDegrees=yes", "endheader", "\t".join(["time", *names, "rectus"])]
    for moment in np.linspace(0, 1, 101):
        values = [0.5 * moment, 0.0, 30 * moment, -60 * moment, moment]
        lines.append("\t".join(f"{each:.6f}" for each in (moment, *values)))
    lines[5] = lines[5].replace("rectus", leg.actuator(0).name)
    path = tmp_path / "walk.mot"
    path.write_text("\n".join(lines))
    return path


def test_a_mot_file_is_read_by_names_and_in_its_units(leg, walk):
    motion = read_motion(walk, leg)
    assert motion.seconds == pytest.approx(1)
    np.testing.assert_allclose(motion.position[-1], [0.5, 0, np.radians(30), np.radians(-60)], atol=1e-6)
    assert motion.activation[50, 0] == pytest.approx(0.5)
    assert not motion.activation[:, 1:].any()


def test_other_files_hold_the_same(leg, walk, tmp_path):
    motion = read_motion(walk, leg)
    names = [leg.joint(i).name for i in range(leg.njnt)]
    rows = np.column_stack([motion.time, motion.position])
    np.savetxt(tmp_path / "walk.csv", rows, delimiter=",", header=",".join(["time", *names]), comments="")
    np.savez(tmp_path / "named.npz", time=motion.time, **dict(zip(names, motion.position.T, strict=True)))
    np.savez(tmp_path / "whole.npz", time=motion.time, qpos=motion.position, activation=motion.activation)
    np.save(tmp_path / "whole.npy", motion.position)
    for name in ("walk.csv", "named.npz", "whole.npz", "whole.npy"):
        found = read_motion(tmp_path / name, leg)
        np.testing.assert_allclose(found.position, motion.position, atol=1e-9)
        np.testing.assert_allclose(found.time, motion.time, atol=1e-9)
    np.testing.assert_array_equal(read_motion(tmp_path / "whole.npz", leg).activation, motion.activation)


def test_unknown_and_missing_columns_are_named(leg, tmp_path):
    path = tmp_path / "bad.csv"
    first, *others = [leg.joint(i).name for i in range(leg.njnt)]
    path.write_text(f"time,{first},wrist\n0,0,0\n1,1,1\n")
    with pytest.raises(ValueError, match=rf"bad.csv: unknown columns: 'wrist'; missing columns: .*{others[0]}"):
        read_motion(path, leg)
    found = read_motion(path, leg, partial=True)
    assert found.position[1, 0] == 1
    path.write_text("a,b\n0,0\n1,1\n")
    with pytest.raises(ValueError, match="missing column: time"):
        read_motion(path, leg)
    with pytest.raises(ValueError, match=r"a file ending in .npz"):
        read_motion(tmp_path / "walk.txt", leg)


def test_joints_that_follow_others_need_no_column(tmp_path):
    model = mujoco.MjModel.from_xml_string(TIED)
    (tmp_path / "a.csv").write_text("time,hinge\n0,0\n1,2\n")
    np.testing.assert_allclose(read_motion(tmp_path / "a.csv", model).position[:, 1], [0.01, 0.01 + 0.04 + 0.12])


def test_opensims_paths_name_joints_and_muscles(leg, tmp_path):
    names = [leg.joint(i).name for i in range(leg.njnt)]
    titles = [f"/jointset/any/{name}/value" for name in names] + ["/jointset/any/hip/speed"]
    titles += [f"/forceset/{leg.actuator(0).name}/activation"]
    text = f"inDegrees=no\nendheader\n{chr(9).join(['time', *titles])}\n0\t1\t2\t3\t4\t9\t.5\n1\t1\t2\t3\t4\t9\t.5\n"
    (tmp_path / "a.sto").write_text(text)
    motion = read_motion(tmp_path / "a.sto", leg)
    np.testing.assert_array_equal(motion.position[0], [1, 2, 3, 4])
    assert motion.activation[0, 0] == 0.5


def test_a_motion_is_played_and_known_to_its_end(leg, walk):
    player = MotionPlayer(setup_of(leg, motion=walk))
    assert player.horizon == 100
    player.advance(50)
    np.testing.assert_allclose(player.sample()["position"][0, 2], np.radians(15), atol=1e-6)
    np.testing.assert_allclose(player.sample()["velocity"][0, 2], np.radians(30), rtol=1e-3)
    state = player.state
    player.advance(101)  # once around
    np.testing.assert_allclose(player.sample()["position"][0, 2], np.radians(15), atol=1e-6)
    player.restore(state)
    assert player.tick == 50
    with pytest.raises(ValueError, match="recorded"):
        player.push("trunk", (1, 0, 0), 0.1)


def test_a_motion_needs_a_model_without_a_learner(walk):
    with pytest.raises(ValueError, match="motion"):
        setup_of("hopper", motion=walk)


def test_patterns_drive_and_are_repeated_bit_for_bit(leg):
    run = BareModel(Setup("leg", model=leg))
    run.drive(Drive((0, 1), "sine", 0.8, 2.0))
    run.drive(Drive((1, 2, 3), "noise", 1.0, 5.0))  # takes the second muscle over
    state, seen = run.state, []
    for _ in range(2):
        run.restore(state)
        rows = [run.step()["control"][0] for _ in range(50)]
        seen.append(np.array(rows))
    np.testing.assert_array_equal(*seen)
    time = run.period * np.arange(50)
    np.testing.assert_allclose(seen[0][:, 0], 0.8 * (0.5 - 0.5 * np.cos(4 * np.pi * time)), atol=1e-9)
    assert len(np.unique(seen[0][30, 1:])) == 3  # each its own noise
    run.control(1, 0.25)
    run.advance(3)
    assert run.sample()["control"][0, 1] == 0.25  # one that is set by hand is driven no more
    with pytest.raises(ValueError, match="pattern = 'square'"):
        Drive((0,), "square")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="amplitude"):
        Drive((0,), "sine", 2.0)


def test_bursts_and_recordings(leg, tmp_path):
    assert [float(Drive((0,), "burst", 0.7, 1.0).shares(at)[0]) for at in (0.2, 0.7, 1.2)] == [0.7, 0.0, 0.7]
    first, second = leg.actuator(0).name, leg.actuator(1).name
    path = tmp_path / "muscles.csv"
    path.write_text(f"time,{second},{first}\n0,0,1\n1,1,0\n")
    seconds, rows, values = read_activations(path, leg)
    assert rows == [1, 0]
    order = DriveRecorded(tuple(rows), seconds, values)
    np.testing.assert_allclose(order.shares(0.25), [0.25, 0.75])
    np.testing.assert_allclose(order.shares(1.25), [0.25, 0.75])
    run = BareModel(Setup("leg", model=leg))
    run.drive(order)
    run.advance(round(0.5 / run.period) + 1)
    np.testing.assert_allclose(run.sample()["control"][0, :2], [0.5, 0.5], atol=0.01)
    path.write_text("time,biceps\n0,0\n1,1\n")
    with pytest.raises(ValueError, match=r"muscles.csv: unknown muscle 'biceps'"):
        read_activations(path, leg)
