"""Sky and light."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from motorgrad.sim.scene._glb import textured
from motorgrad.sim.scene._layer import Layer

if TYPE_CHECKING:
    import viser

    from motorgrad.sim.live import Session
    from motorgrad.sim.scene._pose import Pose

ZENITH, HORIZON = np.array([0.30, 0.50, 0.76]), np.array([0.84, 0.89, 0.93])
"""Colours of the sky, sRGB."""
FAR, SHARE = 500.0, 0.5  # m, radius of the dome: half of how far browsers draw, which is 1,000 m at first
SUN = (-0.45, -0.65, 1.0)  # where it stands


class Sky(Layer):
    """A dome that is paler towards the horizon, a sun that throws shadows, and light from all sides."""

    name = "Shadows"

    def build(self, server: viser.ViserServer, session: Session) -> None:
        self.applies = True
        scene = server.scene
        scene.set_up_direction("+z")
        scene.configure_default_lights(enabled=False)
        scene.configure_environment_map("park", environment_intensity=0.35)
        self._server, self._far = server, FAR
        self._dome = scene.add_glb("/sky/dome", dome(), cast_shadow=False, receive_shadow=False)
        scene.add_light_hemisphere("/sky/glow", sky_color=(214, 230, 255), ground_color=(150, 140, 128), intensity=1.1)
        self._sun = scene.add_light_directional(
            "/sky/sun", color=(255, 247, 232), intensity=2.4, position=SUN, cast_shadow=True
        )

    def draw(self, pose: Pose) -> None:
        """Let the dome be within what all browsers draw, and beyond what they see: a large planet has them see far."""
        clients = self._server.get_clients().values()
        far = SHARE * min((client.camera.far for client in clients), default=FAR / SHARE)
        if far > 0 and far != self._far:
            self._far = far
            self._dome.scale = far / FAR

    def switch(self, shown: bool) -> None:
        if self.applies:
            self._sun.cast_shadow = shown


def dome() -> bytes:
    """The sky as GLB: a sphere seen from inside, which shines by itself."""
    import trimesh

    sphere: Any = trimesh.creation.uv_sphere(FAR, count=(24, 32))
    sphere.invert()
    rise = np.clip(sphere.vertices[:, 2] / FAR, -0.1, 1)
    uv = np.stack([np.full(len(rise), 0.5), (rise + 0.1) / 1.1], axis=1)
    part = np.clip(np.linspace(1.0, -0.1, 256), 0, 1)[:, None] ** 0.55
    shades = HORIZON + part * (ZENITH - HORIZON)
    return textured(sphere, uv, np.repeat(shades[:, None], 4, axis=1), glows=True)
