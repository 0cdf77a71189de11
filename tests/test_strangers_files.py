"""Files that stand for far more than they are, or say what they are not: each is refused at once, in one line."""

import errno
import io
import json
import os
import re
import shutil
import struct
import subprocess
import sys
import tracemalloc
import warnings
import zipfile

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import motorgrad as mg
from audit import zipped
from motorgrad import _limits
from motorgrad._files import read_arrays, read_json, read_toml
from motorgrad._parquet import parquet_in
from motorgrad._reading import array_in, arrays_in, csv_in, entries_in, json_in, toml_in, unpacked
from motorgrad.bodies import read_model
from motorgrad.policies import hyperplanes
from motorgrad.tasks.terms import Follow
from motorgrad.training.store import _checkpoint
from motorgrad.training.store._checkpoint import checksum, is_whole
from motorgrad.training.store._checkpoint import load as load_state
from timlab import DataFile, load, loads
from timlab.blocks._base import read_table
from timsim import read_activations, read_motion
from timsim.live import setup_of
from timsim.live._policy import load_policy

MOST = 100_000  # bytes that these tests let a reader unpack
LITTLE = 200 * 2**20  # bytes that reading takes at most, a hundred for each of a text of 1 MiB
SLIDER = "<mujoco><worldbody><body><joint name='x' type='slide'/><geom size='0.1'/></body></worldbody></mujoco>"


def refusal(read, *arguments, little=LITTLE):
    """What a reader says, in one line, without taking much memory."""
    tracemalloc.start()
    try:
        with pytest.raises(ValueError, match=r".") as error:
            read(*arguments)
        assert tracemalloc.get_traced_memory()[1] < little
    finally:
        tracemalloc.stop()
    said = str(error.value)
    assert len(said.splitlines()) == 1
    assert len(said) < 1000
    return said


def said_of(read):
    """What is said of a file in an error or in warnings, in one line each, without taking much memory."""
    tracemalloc.start()
    said = []
    try:
        with warnings.catch_warnings(record=True) as found:
            warnings.simplefilter("always")
            try:
                read()
            except (ValueError, RuntimeError) as error:
                said.append(str(error))
        assert tracemalloc.get_traced_memory()[1] < LITTLE
    finally:
        tracemalloc.stop()
    said += [str(each.message) for each in found]
    assert all(len(each.splitlines()) == 1 for each in said)
    return " | ".join(said)


def npy(array):
    content = io.BytesIO()
    np.lib.format.write_array(content, array, allow_pickle=True)
    return content.getvalue()


def npy_that_says(shape, kind="<f8", rest=bytes(16)):
    """An NPY file of a header, whatever follows."""
    content = io.BytesIO()
    header = {"descr": kind, "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_2_0(content, header)
    return content.getvalue() + rest


def that_says(content, size):
    """A zip file of one entry whose two headers give another size for what it unpacks to."""
    content = bytearray(content)
    for mark, place in ((b"PK\3\4", 22), (b"PK\1\2", 24)):
        struct.pack_into("<I", content, content.index(mark) + place, size)
    return bytes(content)


BOMB = {"x.npy": npy(np.zeros(10 * MOST))}


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (zipped(BOMB), "bytes when unpacked = 8000128: must be at most 100,000"),
        (that_says(zipped(BOMB), 4_000_000_000), "bytes when unpacked = 4000000000"),
        (that_says(zipped(BOMB), 200), "CRC"),  # what it holds is more than it says
        (zipped(BOMB, zipfile.ZIP_BZIP2), "bytes when unpacked"),
        (that_says(zipped(BOMB, zipfile.ZIP_BZIP2), 200), "stored or deflated"),
        (that_says(zipped(BOMB, zipfile.ZIP_LZMA), 200), "stored or deflated"),
        (zipped({f"{n}.npy": b"" for n in range(10_001)}, zipfile.ZIP_STORED), "entries = 10001"),
        (zipped({"x.npy": npy_that_says((10**12,))}), "of the 16 bytes that there are"),
        (zipped({"x.npy": npy(np.array([{}], object))}), "Object arrays cannot be loaded"),
        (b"PK", "zip"),
    ],
)
def test_an_archive_cannot_become_more_than_it_may(content, told):
    assert told in refusal(arrays_in, content, MOST)


@pytest.mark.parametrize(
    ("shape", "kind"),
    [((10**12,), "<f8"), ((-1, 5), "<f8"), ((10**12,), "|S0"), ((2,), "|S1000000000"), ((10**4000,), "|u1")],
)
def test_an_array_is_no_larger_than_what_follows_its_header(shape, kind):
    said = refusal(array_in, npy_that_says(shape, kind))
    assert "of the 16 bytes that there are" in said or "digits" in said


def test_a_text_whose_numbers_are_no_characters_is_refused():
    whole = npy(np.array("abc"))
    assert refusal(array_in, whole[:-4] + b"\xff\xff\xff\x7f")
    assert str(array_in(whole)) == "abc"


def test_what_numpy_writes_is_read():
    arrays = {
        "scalar": np.array(3.0),
        "empty": np.zeros((0, 3)),
        "fortran": np.asfortranarray(np.arange(6.0).reshape(2, 3)),
        "names": np.array(["a", "b"]),
        "record": np.zeros(2, [("é", float)]),
    }
    for save in (np.savez, np.savez_compressed):
        content = io.BytesIO()
        save(content, **arrays)
        found = arrays_in(content.getvalue(), MOST)
        assert found.keys() == arrays.keys()
        for name, array in arrays.items():
            np.testing.assert_array_equal(found[name], array)


DEEP = "[" * 200 + "]" * 200


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (f"{'.'.join(['a'] * 100_000)} = 1", "must be of at most 30 names"),
        (".".join(['"a"'] * 50_000) + " = 1", "must be of at most 30 names"),
        ("x = {" + " . ".join(["'a'"] * 50) + " = 1}", "must be of at most 30 names"),
        (f"[{'.'.join(['a'] * 100_000)}]", "must be of at most 30 names"),
        (f"x = {DEEP}", "nested too deeply: must be of at most 100"),
        (f"x = {'[' * 100_000}", "nested too deeply"),
        (f"x = 0x{'f' * 900_000}", "digits: must be of at most 100"),
        (f"x = {'9' * 900_000}", "4300 digits"),
        (f"x = {'9' * 400}", "whole number of about 401 digits: must be of at most 100"),
    ],
)
def test_toml_is_bounded(text, told, tmp_path):
    assert told in refusal(toml_in, text)
    (tmp_path / "x.toml").write_text(text)
    said = refusal(read_toml, tmp_path / "x.toml")
    assert said.startswith(f"{tmp_path / 'x.toml'}: not TOML: ")
    if len(text) < _limits.MAX_BLOCK_SETTINGS_CHARACTERS:
        assert told in refusal(read_table, "settings", text)


def test_a_long_word_of_toml_takes_no_time_and_is_no_key():
    assert toml_in(f"x = '{'a' * 500_000}'\n'a.b' = 1\na.b.c = '{'. ' * 100_000}'")["a.b"] == 1


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (DEEP, "nested too deeply: must be of at most 100"),
        ("[" * 1_000_000, "nested too deeply"),
        ('{"x": ' * 200 + "1" + "}" * 200, "nested too deeply"),
        (f"[{'9' * 900_000}]", "4300 digits"),
        (f"[{'9' * 400}]", "whole number of about 401 digits: must be of at most 100"),
    ],
)
def test_json_is_bounded(text, told, tmp_path):
    assert told in refusal(json_in, text)
    (tmp_path / "x.json").write_text(text)
    assert str(tmp_path / "x.json") in refusal(read_json, tmp_path / "x.json")
    assert "100" in refusal(loads, f'{{"format": "motorgrad diagram", "version": 1, "layout": {text}}}') or "9" in text


def parquet(table, **options):
    sink = pa.BufferOutputStream()
    pq.write_table(table, sink, **options)
    return sink.getvalue().to_pybytes()


def test_a_text_that_many_rows_share_is_counted_in_each():
    shared = pa.DictionaryArray.from_arrays(np.zeros(1000, np.int32), ["x" * 10_000]).cast(pa.string())
    content = parquet(pa.table({"x": shared}), compression="zstd")
    assert len(content) < 10_000
    assert "bytes when unpacked" in refusal(parquet_in, content, MOST)
    assert parquet_in(content, 20 * 2**20)["x"].to_pylist() == shared.to_pylist()


def test_numbers_that_repeat_are_counted():
    same = parquet(pa.table({"x": np.zeros(1_000_000)}), compression="zstd")
    lists = pa.FixedSizeListArray.from_arrays(pa.array(np.zeros(1_000_000)), 1000)
    assert len(same) < 10_000
    assert "bytes when unpacked = 8000000: must be at most 100,000" in refusal(parquet_in, same, MOST)
    assert "bytes when unpacked = 8000000" in refusal(parquet_in, parquet(pa.table({"x": lists})), MOST)


def test_lists_of_any_length_are_refused_and_those_of_one_length_read():
    assert "numbers or texts" in refusal(parquet_in, parquet(pa.table({"x": [[1.0], [2.0, 3.0]]})), MOST)
    table = pa.table({"x": pa.FixedSizeListArray.from_arrays(pa.array(np.arange(6.0)), 3), "y": ["a", None]})
    table = table.append_column("z", pa.array(["b", "b"]).dictionary_encode()).replace_schema_metadata({"k": "v"})
    found = parquet_in(parquet(table), MOST)
    assert found.equals(table)
    assert found.schema.metadata == table.schema.metadata


def test_a_line_of_names_has_so_many_columns():
    assert "columns = 20001: must be at most 10,000" in refusal(csv_in, b"," * 20_000 + b"\n", MOST)
    assert "bytes when unpacked" in refusal(csv_in, b"x\n" + b"1\n" * 50_000, MOST)


def test_a_state_unpacks_to_no_more_than_its_file(tmp_path):
    head = json.dumps({"format": 2, "names": ["x"]}).encode()
    body = head + b"\n" + zipped({"0.npy": npy(np.zeros(1_000_000))})
    (tmp_path / "1.state").write_bytes(checksum(body).encode() + b"\n" + body)
    assert is_whole(tmp_path / "1.state")
    said = refusal(load_state, tmp_path / "1.state")
    assert said.startswith(f"{tmp_path / '1.state'}: bytes when unpacked = 8000128: must be at most ")


@pytest.mark.parametrize("head", ["{}", "[]", '{"format": 2}', '{"format": 2, "names": ["x"]}'])
def test_a_state_of_another_kind_is_refused_by_name(head, tmp_path):
    body = head.encode() + b"\n" + zipped({})
    (tmp_path / "1.state").write_bytes(checksum(body).encode() + b"\n" + body)
    assert str(tmp_path / "1.state") in refusal(load_state, tmp_path / "1.state")


@pytest.mark.parametrize("name", ["walk.npz", "walk.npy"])
def test_a_motion_is_bounded_before_it_is_unpacked(name, tmp_path):
    whole = that_says(zipped({"x.npy": npy(np.zeros(100))}), 2**32 - 1)
    (tmp_path / name).write_bytes(whole if name.endswith("z") else npy_that_says((2**40, 1)))
    said = refusal(read_motion, tmp_path / name, read_model(SLIDER))
    assert said.startswith(f"{tmp_path / name}: ")
    assert "209,715,200" in said or "16 bytes" in said


@pytest.mark.parametrize("shape", [(2**40, 0), (0, 2**40)])
def test_an_array_of_no_numbers_is_not_long(shape):
    assert "must be of the 0 bytes" in refusal(array_in, npy_that_says(shape, rest=b""))
    assert array_in(npy(np.zeros((1000, 0)))).shape == (1000, 0)


STORED = {
    "bytes": ({"x": np.zeros(2**25, bool)}, "bytes when unpacked = 268435456: must be at most 209,715,200"),
    "dates": ({"x": np.zeros(3, "M8[s]")}, "type of an array"),
    "complex numbers": ({"x": np.zeros(3, complex)}, "type of an array"),
    "records": ({"x": np.zeros(3, [("y", float)])}, "type of an array"),
    "a number": ({"qpos": np.float64(0)}, "qpos"),
    "a row": ({"qpos": np.zeros(3)}, "must be rows and columns"),
    "a row of activations": ({"qpos": np.zeros((3, 1)), "activation": np.zeros(3)}, "must be rows and columns"),
    "other rows": ({"qpos": np.zeros((3, 1)), "activation": np.zeros((2, 0))}, "must be 3, one for each moment"),
    "no numbers": ({"qpos": np.zeros((3, 1)), "activation": np.full((3, 1), np.nan)}, "must be finite"),
}


@pytest.mark.parametrize(("arrays", "told"), STORED.values(), ids=STORED)
def test_arrays_that_are_no_motion_are_refused(arrays, told, tmp_path):
    np.savez_compressed(tmp_path / "walk.npz", **arrays)
    assert told in refusal(read_motion, tmp_path / "walk.npz", read_model(SLIDER))
    assert told in refusal(read_activations, tmp_path / "walk.npz", read_model(SLIDER))


WRITTEN = {
    "many names": ("time," + ",".join(map(str, range(50_000))) + "\n" + "0," * 50_000 + "0\n", "unknown columns"),
    "a long name": (f"time,/jointset/{'x' * 10**6}\n0,0\n", "missing columns: 'x'"),
    "a long word": (f"time,x\n0,{'y' * 10**6}\n", "must be a number"),
    "many numbers": ("time," + "x," * 10_000 + "x\n" + "\n" * 10 + "0\n" * 3_000, "numbers = 30"),
    "rows of other lengths": ("time,x\n0,1,2\n3\n", "columns = 3: must be 2 a row"),
}


@pytest.mark.parametrize(("text", "told"), WRITTEN.values(), ids=WRITTEN)
def test_a_text_that_is_no_motion_is_refused_at_once(text, told, tmp_path):
    (tmp_path / "walk.csv").write_text(text)
    assert told in refusal(read_motion, tmp_path / "walk.csv", read_model(SLIDER))


def test_a_motion_of_few_columns_becomes_no_larger_than_a_model(tmp_path, monkeypatch):
    monkeypatch.setattr("timsim.film._motion_file.MAX_MODEL_BYTES", 100)
    (tmp_path / "walk.csv").write_text("time,x\n" + "\n".join(f"{k},0" for k in range(20)))
    said = refusal(lambda: read_motion(tmp_path / "walk.csv", read_model(SLIDER), partial=True))
    assert "rows = 20: must be fewer for 1 coordinates" in said


def test_a_policy_of_holes_is_not_read(tmp_path):
    with open(tmp_path / "policy.npz", "wb") as file:
        file.truncate(2**40)  # which takes no place on the disk
    said = refusal(load_policy, tmp_path / "policy.npz", hyperplanes(2, 3), "particle")
    assert "bytes = 1099511627776: must be at most 1,073,741,824" in said


def test_a_motion_of_years_is_not_played(tmp_path):
    (tmp_path / "walk.csv").write_text("time,x\n0,0\n1e12,0\n")
    said = refusal(lambda: setup_of(read_model(SLIDER), motion=tmp_path / "walk.csv"))
    assert "length of the motion = 1000000000000.0: must be <= 10,000 s" in said


@pytest.mark.parametrize(
    ("arrays", "told"),
    [
        ({"time": np.zeros(2**20, bool), "values": np.zeros(2**20, bool)}, "bytes when unpacked"),
        ({"time": np.float64(0), "values": np.zeros(3)}, "a list of moments"),
        ({"time": np.zeros(2), "values": np.zeros(3)}, "as many moments as rows"),
        ({"time": np.zeros(2, "M8[s]"), "values": np.zeros(2)}, "type of an array"),
    ],
    ids=["bytes", "a number", "other rows", "dates"],
)
def test_a_trajectory_is_bounded(arrays, told, tmp_path):
    np.savez_compressed(tmp_path / "path.npz", **arrays)
    assert told in refusal(lambda: Follow(joints="x", file=str(tmp_path / "path.npz")))


def test_a_trajectory_in_text_is_bounded(tmp_path):
    (tmp_path / "path.csv").write_text("0," * 10**6)
    assert "numbers = 1000000" in refusal(lambda: Follow(joints="x", file=str(tmp_path / "path.csv")))
    (tmp_path / "path.csv").write_text("0,0\n1," + "y" * 10**6)
    assert "could not convert" in refusal(lambda: Follow(joints="x", file=str(tmp_path / "path.csv")))


def test_a_table_counts_eight_bytes_a_number(tmp_path, monkeypatch):
    monkeypatch.setattr("timlab.blocks._tables.MAX_TABLE_BYTES", MOST)
    np.savez_compressed(tmp_path / "t.npz", x=np.zeros(MOST // 4, bool))
    said = refusal(DataFile, str(tmp_path / "t.npz"), ("x",))
    assert "bytes when unpacked = 200000: must be at most 100,000" in said


def test_a_column_given_twice_is_named(tmp_path):
    (tmp_path / "t.csv").write_text("x,x\n1,2\n")
    assert "column = 'x': must be given once" in refusal(DataFile, str(tmp_path / "t.csv"), ("x",))


def test_texts_become_no_objects(tmp_path):
    texts = pa.array(["abcdefgh"] * 2**20)
    (tmp_path / "t.parquet").write_bytes(parquet(pa.table({"x": texts, "y": texts})))
    said = refusal(DataFile, str(tmp_path / "t.parquet"), ("x",), little=2**24)
    assert "column x: must be a list of at least one number" in said


def test_long_texts_of_few_rows_are_counted_before_they_are_unpacked():
    content = parquet(pa.table({f"x{k}": ["a" * MOST] for k in range(10)}), compression="zstd")
    pool = pa.default_memory_pool()
    before = pool.bytes_allocated()
    assert "bytes when unpacked = 100" in refusal(parquet_in, content, MOST)
    assert pool.bytes_allocated() - before < MOST


def test_a_table_that_understates_its_pages_is_bounded_by_their_heads():
    content = parquet(pa.table({"x": ["a" * MOST] * 2}), compression="zstd")
    size = pq.ParquetFile(pa.BufferReader(content)).metadata.row_group(0).column(0).total_uncompressed_size
    zigzag = leb128(2 * size)
    foot = content.rindex(b"PAR1") - 4 - int.from_bytes(content[-8:-4], "little")
    none = bytes([*[0x80] * (len(zigzag) - 1), 0])  # as long, so that nothing moves
    lying = content[:foot] + content[foot:].replace(zigzag, none)
    assert pq.ParquetFile(pa.BufferReader(lying)).metadata.row_group(0).column(0).total_uncompressed_size == 0
    assert "bytes when unpacked = 1000" in refusal(parquet_in, lying, MOST)
    assert parquet_in(content, 2**22)["x"].to_pylist() == ["a" * MOST] * 2


@pytest.mark.parametrize("kind", ["none", "snappy", "gzip", "zstd", "brotli", "lz4"])
def test_pages_of_every_kind_are_counted(kind):
    table = pa.table({"n": np.arange(50_000.0), "t": [f"{i % 7}" for i in range(50_000)], "b": [True, False] * 25_000})
    content = parquet(table, compression=kind, data_page_version="2.0", data_page_size=4000, row_group_size=20_000)
    assert parquet_in(content, 2**22).equals(table)
    assert "bytes when unpacked" in refusal(parquet_in, content, 8 * 150_000 - 1)


def leb128(number: int) -> bytes:
    found = []
    while number > 127:
        found.append(number & 127 | 128)
        number >>= 7
    return bytes([*found, number])


@pytest.mark.parametrize("name", ["t.npz", "t.csv", "t.parquet"])
def test_a_table_is_bounded_before_it_is_unpacked(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    contents = {
        "t.npz": lambda: that_says(zipped({"x.npy": npy(np.zeros(100))}), 2**32 - 1),
        "t.csv": lambda: b"," * 20_000 + b"\n",
        "t.parquet": lambda: parquet(pa.table({"x": np.zeros(2**27 + 1, np.int8)}), compression="zstd"),
    }
    (tmp_path / name).write_bytes(contents[name]())
    said = refusal(DataFile, name, ("x",))
    assert name in said
    assert "1,073,741,824" in said or "10,000" in said


@pytest.mark.parametrize("read", [read_toml, read_json, read_arrays, load, load_state, read_model])
def test_a_pipe_is_no_file(read, tmp_path):
    os.mkfifo(tmp_path / "pipe")  # to read it would take for ever
    assert "file" in refusal(read, tmp_path / "pipe")


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bounded") / "run"
    mg.train("three-state", steps=40, seeds=1, window=20, out=folder, progress=False)
    return folder


PARTS = [
    "config.toml",
    "provenance.json",
    "metrics/SHA256SUMS",
    "metrics/*.parquet",
    "checkpoint/*.state",
    "checkpoint/initial.policies",
]


@pytest.mark.parametrize("part", PARTS)
def test_every_file_of_a_run_is_bounded_before_it_is_read(part, run, tmp_path):
    """A file of 100 GiB that takes no place on the disk."""
    shutil.copytree(run, tmp_path / "run")
    file = sorted((tmp_path / "run").glob(part))[-1]
    os.truncate(file, 100 * 2**30)
    said = said_of(lambda: mg.load(tmp_path / "run").metrics)
    assert file.name in said
    assert re.search(r"bytes = 107374182400: must be at most [0-9,]+", said)


def test_what_would_not_be_read_is_not_saved(tmp_path, monkeypatch):
    """It is as a disk that is too small: learning goes on, and says so."""
    monkeypatch.setattr(_checkpoint, "MAX_CHECKPOINT_BYTES", 1000)
    with pytest.raises(OSError, match=r"takes [0-9,]+ bytes, more than the 1,000 that are read") as error:
        _checkpoint.save(tmp_path / "x.state", {"a": np.zeros(1000)}, {})
    assert error.value.errno == errno.EFBIG
    assert list(tmp_path.iterdir()) == []


def test_a_unit_is_bounded_before_its_description_is_read():
    from timlab.blocks.worlds._fmu import _check_unpacked

    entities = "<!DOCTYPE x [<!ENTITY a 'aaaaaaaaaa'><!ENTITY b '&a;&a;&a;&a;'>]><x>&b;</x>"
    for parts in ({"modelDescription.xml": entities}, {"sources/buildDescription.xml": entities}):
        assert "document type 'x': must be none" in refusal(_check_unpacked, zipped(parts))
    bomb = that_says(zipped({"modelDescription.xml": "<x/>"}), 2**31)
    assert "bytes when unpacked = 2147483648" in refusal(_check_unpacked, bomb)
    _check_unpacked(zipped({"modelDescription.xml": "<x/>", "binaries/x.so": b"\0"}))


def test_an_entry_is_unpacked_piece_by_piece():
    content = that_says(zipped({"x": bytes(50 * 2**20)}), 100)
    with entries_in(content, MOST) as packed:
        assert "CRC" in refusal(unpacked, packed, "x", MOST, little=20 * 2**20)


def test_a_foot_that_arrow_cannot_survive_is_refused():
    """Arrow ends the process where a column has more counts of levels than it can have."""
    content = parquet(pa.table({"x": ["a", "b"]}))
    length = int.from_bytes(content[-8:-4], "little")
    foot = content[-8 - length : -8]
    # of the sizes of the column: the counts of levels, field 3, a list of two numbers, and one of three in its place
    place = foot.index(bytes([0x19, 0x26, 0, 4]))
    more = foot[:place] + bytes([0x19, 0x36, 0]) + foot[place + 2 :]
    spoilt = content[: -8 - length] + more + len(more).to_bytes(4, "little") + b"PAR1"
    code = (
        "import sys\nfrom motorgrad._parquet import parquet_in\n"
        "try:\n    parquet_in(sys.stdin.buffer.read(), 1000)\n"
        "except ValueError as error:\n    print(error)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], input=spoilt, capture_output=True, timeout=600)
    assert done.returncode == 0
    assert done.stdout.startswith(b"not a Parquet table: "), done.stdout
    assert parquet_in(content, 1000)["x"].to_pylist() == ["a", "b"]


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (b"PAR1PAR1", "not a Parquet table"),
        (parquet(pa.table({"x": np.arange(3.0)}))[:-40] + bytes(32) + b"\x20\0\0\0PAR1", "not a Parquet table"),
        (parquet(pa.table({"x": ["ab"] * 3})).replace(b"ab", b"\xff\xfe"), "not a Parquet table: .*UTF8"),
    ],
    ids=["no foot", "a foot of zeros", "texts that are none"],
)
def test_a_damaged_table_is_no_error_of_arrow(content, told):
    assert re.search(told, refusal(parquet_in, content, MOST))
