"""Export of learned policies: pure functions of JAX as C, as ONNX models and as files for NumPy.

A function is traced once to a short list of plain operations, its `Program`. C, ONNX and NumPy each spell these. So
every policy can be exported, also one of your own. `Policy.export` is the way in; this room knows no policy.
"""

from motorgrad.export._c import c_source
from motorgrad.export._c_numbers import literal as c_literal
from motorgrad.export._c_numbers import type_of as c_type
from motorgrad.export._numpy import NUMPY_LACKS, numpy_file
from motorgrad.export._onnx import ONNX_LACKS, onnx_model
from motorgrad.export._program import Operation, Program, Untranslatable
from motorgrad.export._reader import read
from motorgrad.export._trace import traced

__all__ = [
    "NUMPY_LACKS",
    "ONNX_LACKS",
    "Operation",
    "Program",
    "Untranslatable",
    "c_literal",
    "c_source",
    "c_type",
    "numpy_file",
    "onnx_model",
    "read",
    "traced",
]
