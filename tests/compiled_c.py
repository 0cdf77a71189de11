"""Exported C, compiled and called from Python."""

import ctypes
import shutil
import subprocess

import numpy as np
import pytest

from motorgrad.export import c_source

COMPILER = shutil.which("gcc") or shutil.which("cc")
FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-Wall", "-Wextra", "-pedantic", "-Werror", "-shared", "-fPIC")
needs_compiler = pytest.mark.skipif(COMPILER is None, reason="there is no C compiler")


class CompiledC:
    """The functions of some programs, compiled as one file."""

    def __init__(self, programs, folder):
        source, library = folder / "policy.c", folder / "policy.so"
        source.write_text(c_source(programs))
        made = subprocess.run([COMPILER, *FLAGS, "-o", library, source, "-lm"], capture_output=True, text=True)
        assert made.returncode == 0, made.stderr
        self._library, self._programs = ctypes.CDLL(str(library)), programs

    def __call__(self, name, given):
        program = self._programs[name]

        def array(place, value=0):
            operation = program.operations[place]
            return np.array(np.broadcast_to(value, operation.shape), operation.dtype, order="C")

        arrays = {each: array(place, given[each]) for each, place in program.inputs.items()}
        arrays |= {each: array(place) for each, place in program.outputs.items() if each not in arrays}
        getattr(self._library, f"policy_{name}")(*(ctypes.c_void_p(each.ctypes.data) for each in arrays.values()))
        return {each: arrays[each] for each in program.outputs}
