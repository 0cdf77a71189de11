"""Exported policies that others made: a file can ask for arithmetic on its arrays, and for nothing else."""

import io
import json
import os
import zipfile

import numpy as np
import pytest

from motorgrad.export import read

SOURCE = np.arange(6.0).reshape(2, 3)
REFUSED = {
    "a file is written": ["savetxt", ["{folder}/there.txt", "a"]],
    "an array is written": ["save", ["{folder}/there.npy", "a"]],
    "an array writes itself": ["ndarray.tofile", ["a", "{folder}/there"]],
    "a file is read": ["fromfile", ["{folder}/file.npz"]],
    "text is read": ["genfromtxt", ["{folder}/file.npz"]],
    "a pickle is read": ["load", ["{folder}/file.npz", None, True]],
    "a file is mapped": ["memmap", ["{folder}/there", "float64", "w+"]],
    "a web page is read": ["DataSource", ["{folder}"]],
    "a module": ["lib", []],
    "memory by a number": ["zeros", [[10**12]]],
    "a range": ["arange", [10**12]],
    "repetitions": ["repeat", ["a", 10**12]],
    "repetition by expansion": ["broadcast_to", ["a", [10**9, 2, 3]]],
    "a sum over an expansion of many axes": ["broadcast_to", [1.0, [1] * 40]],
    "a product of all with all": ["einsum", ["a,b->ab", "long", "long"]],
    "a sum over all with all": ["einsum", ["a,b->", "long", "long"]],
    "a rule of another form": ["einsum", ["ab,bc,cd->ad", "a", "a"]],
    "a rule that is an array": ["einsum", ["a", "a", "a"]],
    "a place to write to": ["add", ["a", "a", "a"]],
    "too few arguments": ["add", ["a"]],
    "text in place of an array": ["add", ["a", "file.npz"]],
    "nothing in place of an array": ["add", ["a", None]],
    "a list in place of an array": ["add", ["a", [[1, 2]]]],
    "a table of keywords": ["add", ["a", {"out": "a"}]],
    "an integer of 400 digits": ["power", [10**400, 2]],
    "an integer beyond 64 bits": ["power", [2**64, 2]],
    "an axis that is not there": ["argmax", ["a", 2]],
    "an axis of text": ["cumsum", ["a", "0"]],
    "axes that are truths": ["sum", ["a", [True]]],
    "an axis twice": ["sum", ["a", [0, 0]]],
    "another number of elements": ["reshape", ["a", [7]]],
    "a length that is found out": ["reshape", ["a", [-1]]],
    "an array later made": ["add", ["a", "later"]],
    "no name": [["add"], ["a", "a"]],
}
DAMAGED = {
    "no list": {"mode": 3},
    "two parts": {"mode": [{}, []]},
    "steps that are a table": {"mode": [{}, {}, {}]},
    "a step of two parts": {"mode": [{}, [["v", "abs"]], {}]},
    "an input of text": {"mode": [{"x": ["v", [2], "U9"]}, [], {}]},
    "an input of objects": {"mode": [{"x": ["v", [2], "O"]}, [], {}]},
    "a step of objects": {"mode": [{}, [["v", "abs", ["a"], "object"]], {}]},
    "an input without end": {"mode": [{"x": ["v", [10**12], "bool"]}, [], {}]},
    "an array made twice": {"mode": [{}, [["a", "abs", ["a"], "float32"]], {}]},
    "a name that is a rule": {"mode": [{}, [["a,b->ab", "abs", ["a"], "float32"]], {}]},
    "an unknown output": {"mode": [{}, [], {"action": "v9"}]},
    "a list": [],
}


def file_of(folder, functions, **more):
    path = folder / "file.npz"
    np.savez(path, functions=np.asarray(json.dumps(functions)), a=SOURCE, long=np.zeros(2**15, bool), **more)
    return path


@pytest.mark.parametrize("call", REFUSED.values(), ids=REFUSED)
def test_another_call_is_refused_by_name_before_anything_is_computed(call, tmp_path):
    name, given = call
    given = [each.format(folder=tmp_path) if isinstance(each, str) else each for each in given]
    path = file_of(tmp_path, {"mode": [{}, [["v", name, given, "float64"]], {"action": "v"}]})
    refusal = r"file\.npz: not an exported policy: function 'mode', step 0: .* is refused: "
    with pytest.raises(ValueError, match=refusal) as told:
        read(path)
    assert str(name) in str(told.value)
    assert "\n" not in str(told.value)
    assert [each.name for each in tmp_path.iterdir()] == ["file.npz"]


@pytest.mark.parametrize("functions", DAMAGED.values(), ids=DAMAGED)
def test_a_damaged_list_is_refused(functions, tmp_path):
    with pytest.raises(ValueError, match=r"file\.npz: not an exported policy: "):
        read(file_of(tmp_path, functions))


def test_a_sum_over_nothing_is_counted_as_what_it_makes(tmp_path):
    long = [["z", "broadcast_to", ["none", [0, 2**27]], "float64"], ["w", "concatenate", [["z", "z"], 1], "float64"]]
    for call in (["sum", ["w", [0]]], ["einsum", ["ab,ab->b", "w", "w"]]):
        path = file_of(tmp_path, {"mode": [{}, [*long, ["v", *call, "float64"]], {}]}, none=np.zeros((0, 1)))
        with pytest.raises(ValueError, match=r"step 2: .*more than 134,217,728 numbers"):
            read(path)


def test_a_list_of_functions_is_bounded_before_it_is_read(tmp_path):
    path = tmp_path / "file.npz"
    np.savez_compressed(path, functions=np.asarray("[" + "[]," * 6_000_000))
    with pytest.raises(ValueError, match=r"18,000,001 characters: at most 16,777,216"):
        read(path)


def test_a_missing_input_is_named(tmp_path):
    function = read(file_of(tmp_path, {"mode": [{"x": ["v", [2], "float32"]}, [], {}]}))["mode"]
    with pytest.raises(TypeError, match=r"missing inputs \['x'\]"):
        function()


def test_what_adds_up_is_refused(tmp_path):
    steps = [[f"v{k}", "broadcast_to", [1.0, [2**25]], "float64"] for k in range(5)]
    with pytest.raises(ValueError, match=r"step 4: broadcast_to\(.*more than 134,217,728 numbers"):
        read(file_of(tmp_path, {"mode": [{}, steps, {}]}))


def packed(folder, members, method=zipfile.ZIP_DEFLATED):
    path = folder / "file.npz"
    with zipfile.ZipFile(path, "w", method) as file:
        for name, content in members.items():
            file.writestr(name, content)
    return path


def array(value, **settings):
    file = io.BytesIO()
    np.save(file, value, **settings)
    return file.getvalue()


def headed(text):
    """An array whose header is a text, as it stands."""
    text = text.encode().ljust(117) + b"\n"
    return b"\x93NUMPY\1\0" + len(text).to_bytes(2, "little") + text + bytes(16)


FUNCTIONS = array(np.asarray("{}"))


@pytest.mark.parametrize(
    "content",
    [
        array(np.asarray([print], object), allow_pickle=True),
        array(np.zeros(2, [("x", float)])),
        array(np.zeros(2, "M8[s]")),
        array(np.zeros(1000)).replace(b"(1000,), }        ", b"(1000000000000,), }"),
        array(np.zeros(1000))[:-8],
        b"",
        headed("{'descr': '<f8', 'shape': (((("),
        headed("{'descr': " + "-" * 9000 + "1}"),
        headed("  1\n 2"),
    ],
    ids=[
        *("objects", "records", "dates", "a header of terabytes", "half an array", "nothing"),
        *("a header without end", "a header of signs", "a header of wrong lines"),
    ],
)
def test_an_array_that_is_no_array_of_numbers_is_refused(content, tmp_path):
    with pytest.raises(ValueError, match=r"file\.npz: not an exported policy: "):
        read(packed(tmp_path, {"functions.npy": FUNCTIONS, "a.npy": content}))


def test_a_small_file_of_gigabytes_is_refused(tmp_path):
    path = packed(tmp_path, {"functions.npy": FUNCTIONS, "a.npy": array(np.zeros(1000))})
    content = path.read_bytes()
    with zipfile.ZipFile(path) as file:
        size = file.getinfo("a.npy").file_size
    path.write_bytes(content.replace(size.to_bytes(4, "little"), (2**31).to_bytes(4, "little")))
    with pytest.raises(ValueError, match=r"2,147,48.* bytes unpacked: at most 1,073,741,824 are read"):
        read(path)


def test_a_file_that_understates_its_size_is_read_no_further(tmp_path):
    path = packed(tmp_path, {"functions.npy": FUNCTIONS, "a.npy": array(np.zeros(10**6))})
    with zipfile.ZipFile(path) as file:
        size = file.getinfo("a.npy").file_size
    path.write_bytes(path.read_bytes().replace(size.to_bytes(4, "little"), (1000).to_bytes(4, "little")))
    with pytest.raises(ValueError, match=r"file\.npz: not an exported policy: "):
        read(path)


@pytest.mark.parametrize("method", [zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA], ids=["bzip2", "lzma"])
def test_what_is_unpacked_as_a_whole_is_not_unpacked(method, tmp_path):
    path = packed(tmp_path, {"functions.npy": FUNCTIONS, "a.npy": bytes(10**6)}, method)
    path.write_bytes(path.read_bytes().replace((10**6).to_bytes(4, "little"), (1000).to_bytes(4, "little")))
    with pytest.raises(ValueError, match=r"functions\.npy: must be stored or deflated"):
        read(path)


def test_a_file_of_many_entries_is_refused_before_they_are_listed(tmp_path):
    path = tmp_path / "file.npz"
    path.write_bytes(b"PK\1\2" * 10_001)
    with pytest.raises(ValueError, match=r"must be of at most 10,000 arrays"):
        read(path)


def test_a_pipe_is_no_exported_policy(tmp_path):
    os.mkfifo(tmp_path / "file.npz")  # to read it would take for ever
    with pytest.raises(ValueError, match=r"file\.npz: not an exported policy: must be a file"):
        read(tmp_path / "file.npz")


def test_lists_in_lists_are_refused(tmp_path):
    path = packed(tmp_path, {"functions.npy": array(np.asarray("[" * 10**5))})
    with pytest.raises(ValueError, match=r"file\.npz: not an exported policy: "):
        read(path)


def test_what_a_caller_changes_is_not_in_the_policy(tmp_path):
    start = read(file_of(tmp_path, {"start": [{}, [], {"memory": "a"}]}))["start"]
    start()["memory"][:] = 0
    np.testing.assert_array_equal(start()["memory"], SOURCE)
