"""A server with panels, as a page has it."""

import contextlib
import threading
import types

import viser

from timsim.panels import Panels
from timsim.scene import Pose


@contextlib.contextmanager
def studio(session, scene=None):
    """A server with the panels of a session, renewed as a page does it."""
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    panels, pose, stop, failed = Panels(), Pose(session.model), threading.Event(), []
    parts = [panels] if scene is None else [scene, panels]
    for part in parts:
        part.build(server, session)

    def run():
        try:
            while not stop.wait(1 / 30):
                snapshot = session.snapshot()
                pose.place(snapshot)
                for part in parts:
                    part.update(snapshot, pose)
        except Exception as error:
            failed.append(error)

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield types.SimpleNamespace(
            server=server, panels=panels, pose=pose, session=session, url=f"http://127.0.0.1:{server.get_port()}"
        )
    finally:
        stop.set()
        thread.join()
        panels.close()
        server.stop()
    assert not failed, failed
