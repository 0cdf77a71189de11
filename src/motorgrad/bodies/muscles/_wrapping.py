"""The length of a muscle that wraps around a joint capsule, in closed form, independent of MuJoCo (the tests compare
both).

Lengths are in m, angles in rad. `angle` is θ in the source: the angle at the joint's centre between the two
attachments, measured on the side *away* from the muscle. It is the joint's interior angle for a muscle behind the joint
(an extensor), and 2π minus it for one in front (a flexor); `away_angle` converts. The muscle spans the angle 2π − θ
around the centre, and touches the capsule if that exceeds what the two tangents span, that is for θ < θ_c.
"""

from typing import Any

import numpy as np

from motorgrad._arrays import Real, Vector
from motorgrad._errors import check


def wrapping_angle(origin_distance: Real, insertion_distance: Real, radius: Real) -> Any:
    """The angle θ_c = 2π − α_A − α_B below which the path touches the capsule, with α = acos(ρ / l).

    **Arguments:** distances of the two attachments from the joint's centre, and the capsule's radius, in m (arrays
    broadcast). The distances must be at least the radius.

    **Returns:** θ_c in rad, from π to 2π.
    """
    _check_lengths(origin_distance, insertion_distance, radius)
    return 2.0 * np.pi - np.arccos(radius / origin_distance) - np.arccos(radius / insertion_distance)


def wrapped_length(angle: Real, origin_distance: Real, insertion_distance: Real, radius: Real) -> Any:
    """The length of the shortest path around the capsule.

    `l_A sin α_A + l_B sin α_B + ρ (θ_c − θ)` where it wraps (θ < θ_c), else the straight distance.

    **Arguments:** θ in rad, from 0 to 2π, on the side away from the muscle (`away_angle`); the others as in
    `wrapping_angle`.

    **Returns:** the length in m, with a continuous first derivative in θ.

    Source: the thesis behind this library, appendix A.2.
    """
    critical = wrapping_angle(origin_distance, insertion_distance, radius)
    wrapped = _tangent(origin_distance, radius) + _tangent(insertion_distance, radius) + radius * (critical - angle)
    return np.where(angle < critical, wrapped, _straight(angle, origin_distance, insertion_distance))


def wrapped_rate(angle: Real, velocity: Real, origin_distance: Real, insertion_distance: Real, radius: Real) -> Any:
    """The rate of `wrapped_length` in m/s: `−ρ dθ/dt` where the path wraps, else the derivative of the distance.

    **Arguments:** `velocity`: dθ/dt in rad/s; the others as in `wrapped_length`.
    """
    critical = wrapping_angle(origin_distance, insertion_distance, radius)
    distance = _straight(angle, origin_distance, insertion_distance)
    # at a fully folded joint with equal attachments, the distance and its derivative are both 0
    safe = np.where(distance > 0.0, distance, 1.0)
    straight = origin_distance * insertion_distance * np.sin(angle) / safe * velocity
    return np.where(angle < critical, -radius * np.asarray(velocity), straight)


def away_angle(interior: Real, behind: bool) -> Any:
    """Convert a joint's interior angle to the angle θ of this module: unchanged if the muscle passes `behind` the joint
    (an extensor), else 2π minus it (a flexor)."""
    return interior if behind else 2.0 * np.pi - np.asarray(interior)


def path_points(
    origin: Vector, insertion: Vector, centre: Vector, radius: float, side: Vector, arc_points: int = 16
) -> np.ndarray:
    """Points along the path in space, for drawing.

    **Arguments:**

    - `origin`, `insertion`, `centre`: points (3,) in m; the path lies in their plane.
    - `radius`: the capsule's radius in m.
    - `side`: a point (3,) on the side where the muscle passes.
    - `arc_points`: points along the arc, ≥ 2.

    **Returns:** `(2, 3)` for a straight path, `(arc_points + 2, 3)` for a wrapped one, from origin to insertion.
    """
    check(arc_points >= 2, "arc_points", arc_points, "at least 2")
    origin, insertion, centre, side = (np.asarray(p, float) for p in (origin, insertion, centre, side))
    a = origin - centre
    b = insertion - centre
    toward = side - centre
    length_a = float(np.linalg.norm(a))
    length_b = float(np.linalg.norm(b))
    _check_lengths(length_a, length_b, radius)
    across = np.array(a / length_a)
    normal = np.cross(a, b)
    if np.linalg.norm(normal) <= 1e-12 * length_a * length_b:  # a straight joint: the side point defines the plane
        normal = np.cross(a, toward)
    wanted = "off the line of the attachments when the joint is straight"
    check(np.linalg.norm(normal) > 0.0, "side", tuple(side), wanted)
    up = np.cross(normal, across)
    up /= np.linalg.norm(up)
    # polar angles in the plane, starting at the origin and turning through the muscle's side
    if up @ toward < 0.0:
        up = -up
    turn = float(np.arctan2(up @ b, across @ b)) % (2.0 * np.pi)
    # the muscle takes the arc that contains the side point: from 0 to `turn`, or the rest of the circle
    side_at = float(np.arctan2(up @ toward, across @ toward)) % (2.0 * np.pi)
    if side_at > turn:
        up = -up
        turn = 2.0 * np.pi - turn
    start = np.arccos(radius / length_a)
    stop = turn - np.arccos(radius / length_b)
    if stop <= start:
        return np.stack([origin, insertion])
    at = np.linspace(start, stop, arc_points)[:, None]
    arc = centre + radius * (np.cos(at) * across + np.sin(at) * up)
    return np.concatenate([origin[None], arc, insertion[None]])


def _tangent(distance: Real, radius: Real) -> Any:
    """Length of the tangent from a point at `distance` from the centre: l sin(acos(ρ/l))."""
    return np.sqrt(np.square(distance) - np.square(radius))


def _straight(angle: Real, origin_distance: Real, insertion_distance: Real) -> Any:
    """The law of cosines, in a form that stays accurate for a folded joint."""
    half = np.sin(np.asarray(angle) / 2.0)
    return np.sqrt(
        np.square(origin_distance - insertion_distance) + 4.0 * origin_distance * insertion_distance * half**2
    )


def _check_lengths(origin_distance: Real, insertion_distance: Real, radius: Real) -> None:
    check(np.all(np.asarray(radius) > 0.0), "radius", radius, "> 0 (m)")
    for name, distance in (("origin_distance", origin_distance), ("insertion_distance", insertion_distance)):
        check(np.all(np.asarray(distance) >= radius), name, distance, f"at least the capsule's radius {radius!r} (m)")
