"""Arrays as text within a page: a table of contents in JSON, then the numbers, compressed."""

import base64
import gzip
import json
from collections.abc import Mapping
from typing import Any

import numpy as np

TYPE_CODES = {"float32": "f4", "int16": "i2", "uint8": "u1", "uint32": "u4"}


def packed(about: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> str:
    """Describe and pack arrays, as base64 of a gzip stream.

    In the stream stand the length of the JSON text (4 bytes, little-endian), the text, and the arrays, each from a
    multiple of 4 bytes on. Arrays of type int16 hold differences along their first axis, which compress better; sums
    wrap around, so the numbers come back exactly.
    """
    table = {}
    parts = []
    place = 0
    for name, array in arrays.items():
        kind = TYPE_CODES[str(array.dtype)]
        values = np.diff(array, axis=0, prepend=np.zeros_like(array[:1])) if kind == "i2" else array
        content = np.ascontiguousarray(values).astype(f"<{kind}").tobytes()
        content += bytes(-len(content) % 4)
        table[name] = [kind, place, list(array.shape)]
        parts.append(content)
        place += len(content)
    text = json.dumps({**about, "arrays": table}, ensure_ascii=False, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    stream = gzip.compress(b"".join([len(text).to_bytes(4, "little"), text, *parts]), mtime=0)
    return base64.b64encode(stream).decode()
