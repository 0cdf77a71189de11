"""Waiting for what a run, a page or a browser is about to do."""

import time

PATIENCE = 600.0
"""Seconds after which a wait is in vain. It ends as soon as it may, so that this costs nothing where all is well."""


def until(true, seconds=PATIENCE, pause=time.sleep):
    """Wait until something is true; whether it became so.

    **Arguments:** `seconds`: how long; less only where the caller tries again. `pause`: waits for so many seconds; a
    browser's own way lets the browser work meanwhile.
    """
    end = time.monotonic() + seconds
    while not true():
        if time.monotonic() > end:
            return False
        pause(0.01)
    return True
