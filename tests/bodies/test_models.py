"""Models from anywhere: what would exhaust memory is refused by name, number and limit, before MuJoCo does any work."""

import json
import os
import re
import struct
import subprocess
import sys
import tracemalloc
import zlib
from pathlib import Path

import gymnasium
import mujoco
import numpy as np
import pytest

import timlab
from motorgrad.bodies import Hopper, compile_model, read_model, to_mjcf
from motorgrad.tasks import Gymnasium
from timsim import live

BODY = '<body name="b"><joint name="j"/><geom name="g" size="0.1"/></body>'


def mjcf(world="", asset="", head="", tail=""):
    return f"<mujoco>{head}<asset>{asset}</asset><worldbody>{world}{BODY}</worldbody>{tail}</mujoco>"


def copied(inner, *counts):
    for count in counts:
        inner = f'<replicate count="{count}" sep="-">{inner}</replicate>'
    return inner


def attached(times):
    """A body of two copies of a body of two copies of ..."""
    twice = '<body name="a{0}"><attach body="a{1}" prefix="x{0}"/><attach body="a{1}" prefix="y{0}"/></body>'
    return BODY.replace('"b"', '"a0"') + "".join(twice.format(i, i - 1) for i in range(1, times))


def sensors(many):
    return "<sensor>" + '<framepos objtype="body" objname="c"/>' * many + "</sensor>"


def texture(given):
    return f'<texture name="t" type="2d" {given}/>'


def field(given):
    return f'<hfield name="h" size="1 1 1 1" {given}/>'


def touch_grid(size):
    config = {"size": size, "fov": "45 45", "gamma": "0", "nchannel": "6"}
    keys = "".join(f'<config key="{key}" value="{value}"/>' for key, value in config.items())
    sensor = f'<plugin name="t" plugin="mujoco.sensor.touch_grid" objtype="site" objname="s">{keys}</plugin>'
    extension = '<extension><plugin plugin="mujoco.sensor.touch_grid"/></extension>'
    return mjcf('<site name="s"/>', head=extension, tail=f"<sensor>{sensor}</sensor>")


FLAT = 'builtin="flat"'
RESERVING = '<size njmax="8000" nconmax="4000"/>'  # 3 GiB by MuJoCo's rule
GRID = '<flexcomp name="f" type="grid" dim="3" spacing=".1 .1 .1" mass="1" '
CELL = '<body name="c"><freejoint/><geom size="0.1"/></body>'
CAMERA = '<camera name="c" resolution="30000 30000" output="depth"/>'
BAR = '<general joint="j" '
FAR = '<body pos="inf 0 0"><joint name="far"/><geom size="0.1"/></body>'
MUSCLE = '<actuator><muscle joint="far"/></actuator>'
DOCUMENTS = {  # what is attacked: (document or file, what the message says)
    "texture": (
        mjcf(asset=texture(f'{FLAT} width="32000" height="32000"')),
        "texture 't': width × height = '32000 × 3",
    ),
    "texture of 32 bits": (mjcf(asset=texture(f'{FLAT} width="65536" height="65537"')), "'65536 × 65537'"),
    "cube": (mjcf(asset='<texture name="t" builtin="flat" width="20000" height="9"/>'), "'20000 × 120000'"),
    "textures": (
        mjcf(asset="".join(texture(f'{FLAT} width="12000" height="12000"').replace('"t"', f'"{i}"') for i in range(3))),
        "texture '2'",
    ),
    "height field": (
        mjcf(asset=field('nrow="100000" ncol="100000"')),
        "<hfield> in line 1: nrow × ncol = '100,000 × 1",
    ),
    "grid": (mjcf(asset='<mesh name="m" builtin="grid" params="2000 2000 2000 1 1 1"/>'), "<mesh> in line 1: params"),
    "torus": (mjcf(asset='<mesh name="m" builtin="supertorus" params="60000 1 1 1"/>'), "<mesh> in line 1: params"),
    "keys": (mjcf(head='<size nkey="2000000000"/>'), "nkey = 2000000000"),
    "user data": (mjcf(head='<size nuserdata="2000000000"/>'), "nuserdata = 2000000000"),
    "user data of geoms": (mjcf(head='<size nuser_geom="2000000000"/>'), "nuser_geom = 2000000000"),
    "memory": (
        mjcf(head='<size memory="50G"/>'),
        "memory = 53687091200: must be such that the model takes at most 8",
    ),
    "stack": (mjcf(head='<size nstack="2000000000"/>'), "nstack = 2000000000"),
    "constraints": (mjcf(head='<size njmax="2000000"/>'), "njmax = 2000000"),
    "contacts": (mjcf(head='<size nconmax="2000000000"/>'), "nconmax = 2000000000"),
    "pile": (
        mjcf(copied(CELL, 100), head=f'{RESERVING}<option solver="PGS"/>'),
        "without <size memory=...>, = 8601: must be such that the model takes at most 2 GiB, not 2.",
    ),
    "replicate": (mjcf(copied(CELL, 3_000_000)), "<replicate> in line 1: count = '3000000': must be at most 2,000"),
    "replicate nested": (
        mjcf(copied(CELL, 200, 200, 200)),
        "copies, = 160200: must be at most 100,000",
    ),
    "replicate nothing": (mjcf(copied("", 2_000_000_000)), "count = '2000000000'"),
    "replicate what is sensed": (mjcf(copied(CELL, 1000), tail=sensors(1000)), "parts, with all copies,"),
    "replicate by an entity": (mjcf(copied(CELL, "&#57;&#57;99")), "count = '9999'"),
    "replicate oddly": (mjcf(copied(CELL, "9999x")), "'9999x': must be whole numbers"),
    "composite": (mjcf('<composite type="cable" count="1000000 1 1"/>'), "<composite> in line 1: parts"),
    "flexcomp": (
        mjcf(f'{GRID} count="1000 1000 1000"/>'),
        "<flexcomp> in line 1: parts, with all copies, = 80000",
    ),
    "flexcomp of cells": (mjcf(f'{GRID} count="3 3 3" cellcount="90 90 90" dof="trilinear"/>'), "<flexcomp> in line 1"),
    "attach": (mjcf(attached(40)), "<body> in line 1: parts, with all copies,"),
    "attach what is sensed": (mjcf(attached(9), tail=sensors(1000).replace('"c"', '"a0"')), "parts, with all copies,"),
    "sensor": (mjcf(tail='<sensor><user name="u" dim="2000000000"/></sensor>'), "dim of sensor 'u' = 2000000000"),
    "sensor of contacts": (mjcf(tail='<sensor><contact geom1="g" num="90000000"/></sensor>'), "num of sensor"),
    "sensor's history": (mjcf(tail='<sensor><jointpos joint="j" nsample="900000000"/></sensor>'), "nsample of sensor"),
    "sensor of a camera": (
        mjcf(CAMERA, tail='<sensor><rangefinder camera="c" data="dist"/></sensor>'),
        "resolution of the camera of sensor '' = '30000 × 30000'",
    ),
    "sensor of a plugin": (touch_grid("60000 30000"), "size of sensor 't' = '60000 30000'"),
    "actuator's history": (mjcf(tail=f'<actuator>{BAR} nsample="900000000"/></actuator>'), "nsample of actuator"),
    "activations": (mjcf(tail=f'<actuator>{BAR} dyntype="user" actdim="900000000"/></actuator>'), "actdim of actuator"),
    "length range": (mjcf(head='<compiler><lengthrange inttotal="1e9"/></compiler>'), "inttotal / timestep"),
    "muscle of a body at infinity": (mjcf(FAR, tail=MUSCLE), "accelerations infinite or huge': must be finite, so"),
    "muscle of a huge joint": (
        mjcf(FAR.replace("inf 0 0", "0 0 0").replace("/>", ' ref="1e200"/>', 1), tail=MUSCLE),
        "huge",
    ),
    "muscle pulled without end": (
        mjcf(head='<compiler><lengthrange accel="inf"/></compiler>'),
        "lengthrange: accel = inf",
    ),
    "document type": ('<!DOCTYPE mujoco [<!ENTITY n "9">]>' + mjcf(), "declares a document type"),
    "comment": (mjcf(f'<body name="<!--"/>{copied(CELL, 9999)}<body name="-->"/>'), "not well-formed XML"),
    "namespace": (mjcf(copied(CELL, 9999)).replace("<mujoco>", '<mujoco xmlns="x">'), "count = '9999'"),
    "null": (mjcf('<body name="\0"/>'), "must be UTF-8"),
    "depth": (mjcf("<body>" * 50_000 + "</body>" * 50_000), "elements within elements = 501: must be at most 500"),
    "include itself": (Path("again.xml"), "files within files = 21: must be at most 20 deep"),
    "include itself from a folder": (Path("deep.xml"), "files within files"),
    "include copies": (mjcf('<include file="copies.xml"/>'), "count = '3000000'"),
    "INCLUDE copies": (mjcf('<INCLUDE file="copies.xml"/>'), "count = '3000000'"),
    "include a device": (mjcf('<include file="/dev/zero"/>'), "file = '/dev/zero': must be a regular file"),
    "include a pipe": (mjcf('<include file="pipe"/>'), "must be a regular file"),
    "include nothing": (mjcf('<include file="gone.xml"/>'), "file = 'gone.xml': must be an existing file"),
    "model of itself": (Path("model.xml"), "files within files = 21"),
    "models of two models": (Path("twice0.xml"), "files within files = 21"),
    "model with copies": (mjcf(asset='<model name="m" file="copies.xml"/>'), "count = '3000000'"),
    "other encoding": (Path("wide.xml"), "must be UTF-8"),
    "picture": (mjcf(asset=texture('file="huge.png"')), "width × height of huge.png = '60000 × 60000'"),
    "picture of heights": (mjcf(asset=field('file="huge.png"')), "width × height of huge.png = '60000 × 60000'"),
    "picture that swells": (mjcf(asset=texture('file="bomb.png"')), "bytes within bomb.png = '1048576 or more': must"),
    "picture with texts": (
        mjcf(asset=texture('file="texts.png"')),
        "texts within texts.png = 'compressed': must be",
    ),
    "heights of 32 bits": (
        mjcf(asset=field('file="wrap.bin" content_type="image/vnd.mujoco.hfield"')),
        "nrow × ncol of wrap.bin = '65537 × 65537'",
    ),
    "texture from a device": (mjcf(asset=texture('file="/dev/zero" content_type="image/png"')), "a regular file"),
    "mesh from a device": (mjcf(asset='<mesh name="m" file="/dev/zero" content_type="model/stl"/>'), "a regular file"),
    "mesh that lies": (mjcf(asset='<mesh name="m" file="lie.stl"/>'), "MuJoCo cannot compile it"),
    "points of a flexcomp": (mjcf(f'{GRID.replace("grid", "mesh")} file="points.obj"/>'), "parts, with all copies,"),
}


def chunk(kind, content):
    body = kind + content
    return struct.pack(">I", len(content)) + body + struct.pack(">I", zlib.crc32(body))


def png(width, height, content, *extra):
    head = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    chunks = (chunk(b"IHDR", head), *extra, chunk(b"IDAT", content), chunk(b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunks)


def zeros(mebibytes):
    """So many zeros, compressed."""
    squeeze = zlib.compressobj(9)
    blocks = [squeeze.compress(bytes(2**20)) + squeeze.flush(zlib.Z_FULL_FLUSH) for _ in range(2)]
    return blocks[0] + blocks[1] * (mebibytes - 1)  # blocks after a flush are alike


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("models")
    (place / "inner").mkdir()
    texts = {
        "copies.xml": mjcf(copied(CELL, 3_000_000)),
        "again.xml": '<mujoco><include file="again.xml"/></mujoco>',
        "deep.xml": '<mujoco><include file="inner/b.xml"/></mujoco>',
        "inner/b.xml": '<mujoco><include file="b.xml"/></mujoco>',
        "model.xml": '<mujoco><asset><model name="m" file="model.xml"/></asset></mujoco>',
        "points.obj": "v 0 0 0\n" * 200_000,
    }
    for i in range(30):
        models = "".join(f'<model name="{name}" file="twice{i + 1}.xml"/>' for name in "ab")
        texts[f"twice{i}.xml"] = f"<mujoco><asset>{models}</asset></mujoco>"
    for name, text in texts.items():
        (place / name).write_text(text)
    (place / "wide.xml").write_text(mjcf(), "utf-16")
    (place / "huge.png").write_bytes(png(60_000, 60_000, zeros(1)))
    (place / "bomb.png").write_bytes(png(16, 16, zeros(20_000)))
    text = chunk(b"zTXt", b"a\0\0" + zeros(16))
    (place / "texts.png").write_bytes(png(4, 4, zlib.compress(bytes(20)), *[text] * 70))
    (place / "wrap.bin").write_bytes(struct.pack("<2i", 65537, 65537) + bytes(4 * (65537**2 - 2**32)))
    (place / "lie.stl").write_bytes(bytes(80) + struct.pack("<I", 2**31 - 1) + bytes(500))
    os.mkfifo(place / "pipe")
    return place


CHILD = """
import json, pathlib, resource, sys
from motorgrad.bodies import read_model
documents = json.load(sys.stdin)
for kind, spare in ((resource.RLIMIT_AS, 2**30), (resource.RLIMIT_CPU, 60)):
    used = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize() if spare > 60 else 0
    resource.setrlimit(kind, (used + spare,) * 2)
peak = lambda: resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024
before, told = peak(), {}
for name, (text, file) in documents.items():
    try:
        read_model(pathlib.Path(file) if file else text)
        told[name] = "compiled"
    except Exception as error:
        told[name] = f"{type(error).__name__}: {error}"
print(json.dumps([told, peak() - before]))
"""


@pytest.fixture(scope="module")
def answers(folder):
    """What is said to each document, by a process with 1 GiB to spare; and the MiB that it took."""
    given = {
        name: (None, str(asked)) if isinstance(asked, Path) else (asked, None) for name, (asked, _) in DOCUMENTS.items()
    }
    python = [sys.executable, "-c", CHILD]
    done = subprocess.run(python, cwd=folder, input=json.dumps(given), capture_output=True, text=True, timeout=1200)
    assert done.returncode == 0, done.stderr[-2000:]
    return json.loads(done.stdout)


@pytest.mark.skipif(sys.platform != "linux", reason="needs limits of memory as Linux has them")
@pytest.mark.parametrize("name", DOCUMENTS)
def test_what_would_exhaust_memory_is_refused_in_one_line(answers, name):
    answer = answers[0][name]
    assert answer.startswith("ValueError: ")
    assert DOCUMENTS[name][1] in answer
    assert "\n" not in answer


@pytest.mark.skipif(sys.platform != "linux", reason="needs limits of memory as Linux has them")
def test_to_refuse_takes_little_memory(answers):
    assert answers[1] < 100  # MiB


def plain():
    return mujoco.MjSpec.from_string(mjcf())


def with_number(name, value):
    spec = plain()
    setattr(spec, name, value)
    return spec


def with_texture(**size):
    spec = plain()
    spec.add_texture(name="t", type=mujoco.mjtTexture.mjTEXTURE_2D, builtin=mujoco.mjtBuiltin.mjBUILTIN_FLAT, **size)
    return spec


def with_heights(side):
    spec = plain()
    heights = [0.0] * (side * side % 2**32)  # what MuJoCo takes for their number
    spec.add_hfield(name="h", nrow=side, ncol=side, userdata=heights, size=(1, 1, 1, 1))
    return spec


def with_a_chain(length):
    spec = mujoco.MjSpec()
    body = spec.worldbody
    for _ in range(length):
        body = body.add_body()
        body.add_joint()
        body.add_geom(size=(0.1, 0, 0))
    return spec


def with_an_octree(depth):
    spec = plain()
    mesh = spec.add_mesh(name="m", needsdf=True, octree_maxdepth=depth)
    mesh.make_sphere(1)
    return spec


def with_free_bodies(many):
    spec = plain()
    for _ in range(many):
        body = spec.worldbody.add_body()
        body.add_freejoint()
        body.add_geom(size=(0.1, 0, 0))
    return spec


def with_attached_texture():
    child, spec = with_texture(width=32_000, height=32_000), plain()
    child.add_material(name="m").textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "t"
    child.geom("g").material = "m"
    spec.attach(child, prefix="of-", frame=spec.worldbody.add_frame())
    return spec


SPECS = {
    "nkey = 2000000000": lambda: with_number("nkey", 2_000_000_000),
    "nuserdata = 2000000000": lambda: with_number("nuserdata", 2_000_000_000),
    "memory = 4611686018427387904": lambda: with_number("memory", 2**62),
    "MuJoCo cannot compile it": lambda: with_number("memory", -7),
    "texture 't': width × height = '32000 × 32000'": lambda: with_texture(width=32_000, height=32_000),
    "texture 't': width × height = '-32000 × -32000'": lambda: with_texture(width=-32_000, height=-32_000),
    "texture 'of-t': width × height": with_attached_texture,
    "height field 'h': nrow × ncol = '65537 × 65537'": lambda: with_heights(65_537),
    "bodies within bodies = 1001: must be at most 1000": lambda: with_a_chain(1_200),
    "octree_maxdepth of mesh 'm' = 30: must be at most 8": lambda: with_an_octree(30),
    "degrees of freedom, without <size memory=...>, = 9501": lambda: with_free_bodies(1_500),
}


@pytest.mark.parametrize("told", SPECS)
@pytest.mark.parametrize("entry", [compile_model, to_mjcf])
def test_a_description_is_refused_likewise(entry, told):
    with pytest.raises(ValueError, match=re.escape(told)):
        entry(SPECS[told]())


@pytest.mark.parametrize(
    "enter",
    [
        read_model,
        live.setup_of,
        lambda path: live.setup_of(str(path)),
        lambda path: timlab.MujocoModel(file=str(path)),
        lambda path: timlab.MujocoModel(path.read_text()),
        lambda path: Gymnasium("Ant-v5", {"xml_file": str(path)}),
        lambda path: Gymnasium("Reacher-v5", {"xml_file": str(path)}),
        lambda path: Gymnasium("CartPole-v1", {"any": str(path)}),
    ],
    ids=[
        "read_model",
        "TimSim",
        "TimSim by name",
        "TimLab's file",
        "TimLab's text",
        "Gymnasium's Ant",
        "Gymnasium's Reacher",
        "another environment",
    ],
)
@pytest.mark.parametrize("attack", ["replicate", "texture", "keys", "include nothing"])
def test_every_way_in_has_the_limits(enter, attack, tmp_path):
    path = tmp_path / "model.xml"
    path.write_text(DOCUMENTS[attack][0])
    with pytest.raises(ValueError, match=re.escape(DOCUMENTS[attack][1])) as raised:
        enter(path)
    said = re.sub(r"^env_id = '[^']*': (xml_file|any): ", "", str(raised.value))
    assert said.startswith(("xml: ", f"file = {str(path)!r}: "))


@pytest.mark.parametrize("given", ["{}", "./{}", "~/{}", "{folder}/{}"])
def test_however_a_path_is_given_to_gymnasium_its_model_has_the_limits(given, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HOME", str(tmp_path))
    (tmp_path / "model").write_text(DOCUMENTS["replicate"][0])  # which MuJoCo reads whatever its name
    path = given.format("model", folder=tmp_path)
    with pytest.raises(ValueError, match=re.escape(DOCUMENTS["replicate"][1])):
        Gymnasium("Ant-v5", {"xml_file": path})


def test_gymnasium_takes_models_within_the_limits(tmp_path):
    assets = Path(gymnasium.__file__).parent / "envs" / "mujoco" / "assets"
    (tmp_path / "hopper.xml").write_text((assets / "hopper.xml").read_text())
    for file in ("hopper.xml", str(tmp_path / "hopper.xml")):
        assert Gymnasium("Hopper-v5", {"xml_file": file}).observation_size == 11


def test_a_backslash_leads_to_no_other_file_than_is_counted(tmp_path):
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "x.xml").write_text(DOCUMENTS["replicate"][0])
    (tmp_path / "in\\x.xml").write_text("<mujoco/>")  # which MuJoCo would not read
    path = tmp_path / "model.xml"
    path.write_text(r'<mujoco><include file="in\x.xml"/></mujoco>')
    with pytest.raises(ValueError, match=re.escape(DOCUMENTS["replicate"][1])):
        read_model(path)
    texture = r'<mujoco><asset><texture name="t" type="2d" file="in\t.png"/></asset></mujoco>'
    head = struct.pack(">I4sIIBB", 13, b"IHDR", 10**6, 10**6, 8, 2)
    (tmp_path / "in" / "t.png").write_bytes(b"\x89PNG\r\n\x1a\n" + head + bytes(7))
    path.write_text(texture)
    with pytest.raises(ValueError, match="1000000 × 1000000"):
        read_model(path)


def test_elements_are_not_counted_within_each_other_without_end():
    tracemalloc.start()
    with pytest.raises(ValueError, match="elements within elements = 501: must be at most 500"):
        read_model("<mujoco>" + "<a>" * 10**5)
    assert tracemalloc.get_traced_memory()[1] < 2**23
    tracemalloc.stop()


def test_a_body_of_ones_own_has_the_limits(monkeypatch):
    spec = Hopper().spec()
    spec.nkey = 2_000_000_000
    monkeypatch.setattr(Hopper, "spec", lambda self: spec)
    for entry in (compile_model, live.setup_of, to_mjcf):
        with pytest.raises(ValueError, match="nkey = 2000000000"):
            entry(Hopper())


@pytest.mark.skipif(sys.platform != "linux", reason="reads the resident memory as Linux tells it")
def test_memory_that_is_reserved_and_not_touched_is_no_reason_to_refuse_a_model():
    """As in rodent.xml of dm_control."""

    def resident():
        return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")

    before = resident()
    model = read_model(mjcf(copied(CELL, 10), head=RESERVING))
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 10)
    assert data.maxuse_con == 55  # all spheres are at one place
    assert data.narena > 2**31
    assert data.maxuse_arena < 2**20
    assert resident() - before < 2**26


def stored(model):
    buffer = np.zeros(mujoco.mj_sizeModel(model), np.uint8)
    mujoco.mj_saveModel(model, None, buffer)
    return buffer.tobytes()


def test_what_is_within_the_limits_is_compiled_as_mujoco_does(folder):
    text = mjcf(
        copied(CELL, 20, 10) + '<include file="part.xml"/><attach model="m" prefix="of-"/>',
        asset=texture('file="fine.png"') + '<model name="m" file="other.xml"/>' + field('nrow="9" ncol="9"'),
        tail=sensors(5).replace('"c"', '"b"'),
    )
    (folder / "part.xml").write_text("<mujoco><body name='p'><geom size='1'/></body></mujoco>")
    (folder / "other.xml").write_text("<mujoco><worldbody><body name='o'><geom size='1'/></body></worldbody></mujoco>")
    (folder / "fine.png").write_bytes(png(8, 8, zlib.compress(bytes(8 * 9))))
    (folder / "all.xml").write_text(text)
    model, own = read_model(folder / "all.xml"), mujoco.MjModel.from_xml_path(str(folder / "all.xml"))
    assert stored(model) == stored(own)
    assert model.nbody == 1 + 200 + 1 + 1 + 1
    assert model.tex_width.tolist() == [8]


def test_a_model_is_edited_before_it_is_compiled():
    model = read_model(mjcf(), lambda spec: spec.worldbody.add_geom(size=(1, 0, 0)))
    assert model.ngeom == 2
    with pytest.raises(ValueError, match=r"^xml: nkey = 2000000000"):
        read_model(mjcf(), lambda spec: setattr(spec, "nkey", 2_000_000_000))
