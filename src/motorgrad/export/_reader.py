"""Reads a policy that motorgrad exported as .npz. It needs NumPy alone: copy it where motorgrad is not installed."""

import json

import numpy as np


def read(path):
    """The functions of an exported policy by name. Each takes arrays by name, and returns arrays by name."""
    with np.load(path) as file:
        arrays = {name: file[name] for name in file.files}
    functions = json.loads(str(arrays.pop("functions")))
    return {name: _function(arrays, *parts) for name, parts in functions.items()}


def _function(arrays, inputs, steps, outputs):
    def call(**given):
        values = dict(arrays)
        for name, (place, shape, dtype) in inputs.items():
            values[place] = np.asarray(given.pop(name), dtype).reshape(shape)
        if given:
            raise TypeError(f"unknown inputs {list(given)}: known are {list(inputs)}")

        def value(x):
            return tuple(map(value, x)) if isinstance(x, list) else values.get(x, x) if isinstance(x, str) else x

        with np.errstate(all="ignore"):
            for place, function, arguments, dtype in steps:
                values[place] = np.asarray(getattr(np, function)(*value(arguments)), dtype)
        return {name: values[place] for name, place in outputs.items()}

    return call
