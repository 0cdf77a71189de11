"""Damaged, foreign and hostile policy files: each is refused in one line, and the run goes on undisturbed."""

import dataclasses
import io
import json
import os
import pickle
import random

import jax
import numpy as np
import pytest

import motorgrad as mg
from audit import zipped
from timsim import live
from timsim.live._policy import STRUCTURE, confined, load_policy, policy_of_run


@pytest.fixture(scope="module")
def good(hopper, tmp_path_factory):
    """A policy that the hopper saved."""
    file = tmp_path_factory.mktemp("good") / "good.npz"
    hopper(live.Reset(), live.Step(50), live.Save(str(file)))
    return file


def entries(file):
    with np.load(file) as stored:
        return dict(stored)


def packed(arrays):
    """The content of a file with these arrays."""
    content = io.BytesIO()
    np.savez(content, **arrays)
    return content.getvalue()


def flaws(file):
    """Contents that are no policy of this hopper, by what is wrong with them."""
    content, arrays = file.read_bytes(), entries(file)
    about = json.loads(str(arrays[STRUCTURE]))
    name, weights = next((name, array) for name, array in arrays.items() if name != STRUCTURE and array.ndim == 2)
    structures = [{}, [], None, 3, "x", {"task": 1}, {**about, "task": "particle"}, {**about, "policy": None}]
    structures += [{**about, "policy": []}, {**about, "policy": {"kind": 3}}, {**about, "policy": {}}]
    structures += [{**about, "task": "x" * 100_000}, {**about, "policy": {**about["policy"], "kind": "os.system"}}]

    def with_weights(entry):
        return zipped({f"{STRUCTURE}.npy": _npy(arrays[STRUCTURE]), f"{name}.npy": entry})

    spotted = weights.copy()
    spotted[0, 1] = np.nan
    spoilt = {
        "empty": b"",
        "text": b"no",
        "zeros": bytes(5000),
        "cut": content[: len(content) // 2],
        "cut by one": content[:-1],
        "twice cut": content[100:-100],
        "pickle": pickle.dumps({"a": 1}),
        "a pickle that runs": b"cos\nsystem\n(S'touch pwned'\ntR.",
        "not zipped": _npy(weights),
        "an empty zip": zipped({}),
        "no structure": packed({n: a for n, a in arrays.items() if n != STRUCTURE}),
        "structure alone": packed({STRUCTURE: arrays[STRUCTURE]}),
        "structure is no JSON": packed({**arrays, STRUCTURE: np.array("{")}),
        "structure is a number": packed({**arrays, STRUCTURE: np.array(3.0)}),
        "structure is bytes": packed({**arrays, STRUCTURE: np.frombuffer(b"\xff\xfe", np.uint8)}),
        "structure is deep": packed({**arrays, STRUCTURE: np.array("[" * 100_000)}),
        "array missing": packed({n: a for n, a in arrays.items() if n != name}),
        "transposed": packed({**arrays, name: weights.T}),
        "flat": packed({**arrays, name: weights.ravel()}),
        "one more axis": packed({**arrays, name: weights[None]}),
        "empty array": packed({**arrays, name: weights[:0]}),
        "double": packed({**arrays, name: weights.astype(float)}),
        "integers": packed({**arrays, name: weights.astype(np.int32)}),
        "text array": packed({**arrays, name: np.full(weights.shape, "x")}),
        "NaN": packed({**arrays, name: weights * np.float32(np.nan)}),
        "one NaN": packed({**arrays, name: spotted}),
        "infinite": packed({**arrays, name: (weights + np.inf).astype(weights.dtype)}),
        "objects": with_weights(_npy(np.array([{}, 1], object))),
        "a bomb": with_weights(bytes(50_000_000)),
        "a huge shape": with_weights(_header((10**15,))),
        "a shape that overflows": with_weights(_header((2**62, 8))),
        "a shape below 0": with_weights(_header((-1, 3))),
        "a header that is code": with_weights(_header("__import__('os')")),
        "encrypted": _flagged(content, 6, 8, 1),
        "an unknown packing": _flagged(content, 8, 10, 77),
    }
    for number, structure in enumerate(structures):
        spoilt[f"structure {number}"] = packed({**arrays, STRUCTURE: np.array(json.dumps(structure))})
    return spoilt


def _npy(array):
    content = io.BytesIO()
    np.lib.format.write_array(content, array, allow_pickle=True)
    return content.getvalue()


def _header(shape):
    """The start of an `.npy` file that promises an array of this shape."""
    text = f"{{'descr': '<f4', 'fortran_order': False, 'shape': {shape}, }}".encode()
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text


def _flagged(content, local, central, value):
    """A zip file with another byte at these places of the heads of its entries."""
    raw = bytearray(content)
    for mark, place in ((b"PK\x03\x04", local), (b"PK\x01\x02", central)):
        start = raw.find(mark)
        while start >= 0:
            raw[start + place] = value
            start = raw.find(mark, start + 4)
    return bytes(raw)


def state_of(driven):
    """Everything that the future of a run depends on."""
    driven.worker.subject.tally()  # its means are taken when the clock says so
    return [np.asarray(leaf) for leaf in jax.tree.leaves(driven.worker.subject.state)]


@pytest.mark.ci
def test_whatever_is_loaded_the_run_goes_on_untouched(hopper, good, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    hopper(live.Reset(), live.Step(200))
    undisturbed = state_of(hopper)
    paths = []
    for number, (flaw, content) in enumerate(flaws(good).items()):
        paths.append((flaw, tmp_path / f"{number}.npz"))
        paths[-1][1].write_bytes(content)
    os.mkfifo(tmp_path / "pipe.npz")
    (tmp_path / "folder.npz").mkdir()
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "config.toml").write_text("[task]\nname = 3\n")
    (tmp_path / "circle.npz").symlink_to("circle.npz")
    (tmp_path / "nowhere.npz").symlink_to("gone.npz")
    odd = ["pipe.npz", "folder.npz", "run", "circle.npz", "nowhere.npz", "missing.npz", ".", "x" * 300 + ".npz"]
    paths += [(name, tmp_path / name) for name in odd]
    hopper(live.Reset(), live.Step(100))
    for flaw, path in paths:
        order = object.__new__(live.Load)  # as it crosses from the page, where it may have been a folder just before
        object.__setattr__(order, "path", str(path))
        object.__setattr__(order, "seed", None)
        ((kind, text),) = hopper(order)
        assert kind == "error", flaw
        assert "\n" not in text
        assert len(text) < 1000 + len(str(path)), flaw
    assert len(paths) > 50
    hopper(live.Step(100))
    np.testing.assert_equal(state_of(hopper), undisturbed)
    assert not (tmp_path / "pwned").exists()
    hopper(live.Reset(), live.Step(100))
    assert hopper(live.Load(str(good))) == [("loaded", f"policy loaded from {good}")]


def test_the_refusal_says_what_is_wrong(hopper, good, tmp_path):
    found = {}
    for flaw, content in flaws(good).items():
        (tmp_path / "x.npz").write_bytes(content)
        ((_, found[flaw]),) = hopper(live.Load(str(tmp_path / "x.npz")))
    assert found["empty"].endswith("x.npz: not a saved policy: File is not a zip file")
    assert "but must be float32 of shape" in found["transposed"]
    assert "numbers that are not finite" in found["one NaN"]
    assert "holds no" in found["array missing"]
    assert "at most" in found["a bomb"]
    ((_, text),) = hopper(live.Load(str(tmp_path)))
    assert "is not a run directory" in text


@pytest.mark.parametrize("files", [500, pytest.param(2000, marks=pytest.mark.ci)])
def test_no_flipped_bit_is_loaded(files, hopper, good, tmp_path):
    """Of so many damaged files what is read at all is what was saved."""
    rng, content, file = random.Random(18), good.read_bytes(), tmp_path / "flipped.npz"
    shape = hopper.worker.subject._stepper.policy
    wanted, refused = jax.tree.leaves(load_policy(str(good), shape, "hopper")[0]), 0
    for _ in range(files):
        raw = bytearray(content)
        for _ in range(rng.choice([1, 1, 1, 2, 8])):
            raw[rng.randrange(len(raw))] ^= 1 << rng.randrange(8)
        if rng.random() < 0.1:
            raw = raw[: rng.randrange(len(raw))]
        file.write_bytes(raw)
        try:
            found = jax.tree.leaves(load_policy(str(file), shape, "hopper")[0])
        except ValueError:
            refused += 1
        else:
            assert all(np.array_equal(a, b) for a, b in zip(found, wanted, strict=True))
    assert refused > files / 2


def test_a_run_whose_policy_is_not_finite_is_refused():
    run = mg.train("chain", steps=5, seeds=1)
    shape = jax.tree.map(lambda leaf: leaf[0], run.policies)
    assert policy_of_run(run, shape, "chain")
    lost = jax.tree.map(lambda leaf: np.full_like(leaf, np.nan), run.policies)
    with pytest.raises(ValueError, match=r"the run: .* has numbers that are not finite"):
        policy_of_run(dataclasses.replace(run, policies=lost), shape, "chain")


def test_only_saved_policies_are_replaced(hopper, good, tmp_path):
    others = [packed({"structure": kept}) for kept in (np.eye(3), np.array("1"), np.array('{"task": "hopper"}'))]
    for content in (b"", b"other", zipped({"x.npy": b"1"}), packed({"x": np.zeros(3)}), *others):
        (tmp_path / "mine.npz").write_bytes(content)
        ((kind, text),) = hopper(live.Save(str(tmp_path / "mine.npz")))
        assert kind == "error"
        assert "must be new, or a saved policy, which is replaced" in text
        assert (tmp_path / "mine.npz").read_bytes() == content
    (tmp_path / "mine.npz").write_bytes(good.read_bytes())
    assert hopper(live.Save(str(tmp_path / "mine.npz")))[0][0] == "saved"
    assert [path.name for path in tmp_path.iterdir()] == ["mine.npz"]


def test_paths_are_confined(tmp_path):
    work, run, other = (tmp_path / name for name in ("work", "run", "other"))
    for folder in (work, run, other, work / "sub"):
        folder.mkdir()
    (work / "out").symlink_to(other)
    (work / "in").symlink_to(work / "sub")
    (work / "far.npz").symlink_to(other / "x.npz")
    (work / "loop").symlink_to("loop")
    folders = [work, run]
    for path, found in (
        ("a.npz", work / "a.npz"),
        ("sub/a.npz", work / "sub" / "a.npz"),
        ("in/a.npz", work / "sub" / "a.npz"),
        ("./a.npz", work / "a.npz"),
        (str(run / "a.npz"), run / "a.npz"),
        (str(work), work),
    ):
        assert confined(path, folders) == found
    wrong = ["", "../a.npz", "sub/../a.npz", "sub/../../other/a.npz", str(other / "a.npz"), "/etc/a.npz", "out/a.npz"]
    wrong += [
        "far.npz",
        "loop/a.npz",
        "a\0.npz",
        f"{work}/../run/a.npz",
        f"{work}x/a.npz",
    ]
    wrong += ["//etc/a.npz", "~/../a.npz", str(tmp_path), "/"]
    for path in wrong:
        with pytest.raises(ValueError, match="path = "):
            confined(path, folders)
