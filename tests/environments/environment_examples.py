"""What the tests of environments share: exact comparison, and actions that make the hopper hop."""

import numpy as np

HOPPER = "motorgrad/Hopper-v0"


def assert_equal(found, wanted, where=""):
    """Equal in every bit, and of the same types; dictionaries by their entries."""
    if isinstance(wanted, dict):
        assert found.keys() == wanted.keys(), where
        for name in wanted:
            assert_equal(found[name], wanted[name], f"{where}/{name}")
        return
    found, wanted = np.asarray(found), np.asarray(wanted)
    assert found.dtype == wanted.dtype, where
    np.testing.assert_array_equal(found, wanted, where)


def hopping(decision):
    """Flex, then extend: the hopper leaves the ground."""
    return np.array([0, 1] if decision % 60 >= 30 else [1, 0], np.int8)


def break_body(environment, row=0):
    """Put an impossible number into the physics of a row, whose numbers begin with time, positions and velocities."""
    body = environment.unwrapped._rows.body
    physics = body.snapshot()
    physics["state"][row, 1] = np.nan
    body.restore(physics)
