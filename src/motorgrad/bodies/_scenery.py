"""Floor, light, sky and cameras, the same for every body."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's compiled modules carry no type information.)

import mujoco

_SKY = ((0.62, 0.74, 0.86), (0.93, 0.95, 0.98))
_TILES = ((0.78, 0.80, 0.80), (0.70, 0.73, 0.74))


def add_scenery(spec: mujoco.MjSpec, rail: tuple[float, float] | None, target: str) -> None:
    """Add a checkered floor at z = 0 (the only thing to touch), light, sky and a rail, and cameras.

    A body on a rail is seen from the side: the camera "side" follows it, "stand" stays and shows hops of up to 1 m.
    One that goes where it likes is followed from above by the camera "above".

    **Arguments:** `spec`, changed in place; `rail`: (x, y) in m of the vertical rail drawn behind a body that is held
    by one, or None; `target`: name of an existing body for the cameras to follow.
    """
    spec.visual.headlight.ambient = (0.4, 0.4, 0.4)
    spec.visual.headlight.diffuse = (0.4, 0.4, 0.4)
    spec.visual.global_.offwidth, spec.visual.global_.offheight = 1280, 960
    builtin = mujoco.mjtBuiltin
    for name, kind, pattern, colours in (
        ("sky", mujoco.mjtTexture.mjTEXTURE_SKYBOX, builtin.mjBUILTIN_GRADIENT, _SKY),
        ("tiles", mujoco.mjtTexture.mjTEXTURE_2D, builtin.mjBUILTIN_CHECKER, _TILES),
    ):
        spec.add_texture(name=name, type=kind, builtin=pattern, rgb1=colours[0], rgb2=colours[1], width=128, height=128)
    floor_material = spec.add_material(name="floor", texrepeat=(4, 4), texuniform=True)
    floor_material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "tiles"
    world = spec.worldbody
    light = world.add_light(pos=(-1.0, -2.0, 3.0), dir=(0.35, 0.6, -1.0), diffuse=(0.55, 0.55, 0.55), castshadow=True)
    light.type = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
    world.add_geom(
        name="floor",
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        size=(0, 0, 0.5),
        material="floor",
        contype=0,
        conaffinity=1,
        solref=(0.005, 1.0),
    )
    if rail is None:
        above = spec.body(target).add_camera(name="above", mode=mujoco.mjtCamLight.mjCAMLIGHT_TRACK, fovy=40.0)
        above.pos = (0.0, 0.0, 2.2)
        return
    world.add_geom(
        name="rail",
        type=mujoco.mjtGeom.mjGEOM_CYLINDER,
        size=(0.008, 1.25, 0),
        pos=(*rail, 1.25),
        rgba=(0.55, 0.58, 0.62, 1.0),
        contype=0,
        conaffinity=0,
    )
    follow = spec.body(target).add_camera(name="side", mode=mujoco.mjtCamLight.mjCAMLIGHT_TRACK, fovy=40.0)
    follow.pos = (0.0, -2.2, -0.1)
    stay = world.add_camera(name="stand", pos=(0.0, -3.0, 0.75), fovy=40.0)
    for camera in (follow, stay):
        # x to the right, z up, seen from negative y
        camera.quat = (0.5**0.5, 0.5**0.5, 0.0, 0.0)
