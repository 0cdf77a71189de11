"""The posing and reaching tasks of MyoSuite, rebuilt as composed tasks."""

from collections.abc import Iterable
from typing import Any, Literal

import numpy as np

from motorgrad._errors import unknown
from motorgrad._myosuite import environment, ids
from motorgrad.bodies import Mjcf
from motorgrad.tasks._composed import Composed, compose
from motorgrad.tasks.terms import (
    Activations,
    Beyond,
    Distance,
    Effort,
    JointPositions,
    JointVelocities,
    Pose,
    Positions,
    RandomJoints,
    Reach,
    Success,
    TargetError,
    Within,
)

POSING = "tasks.basic.arm.pose:PoseEnvV0"
REACHING = "tasks.basic.arm.reach:ReachEnvV0"
VARIANTS = ("myoSarc", "myoFati", "myoReaf")
"""How the ids of environments begin whose muscles are changed by wrappers."""
FAR = 2 * np.pi  # rad, beyond which a pose is lost
NEAR = 0.0125  # m for each site
GRACE = 2  # decisions before a reach can be lost


def myosuite(
    env_id: str,
    *,
    actions: Literal["continuous", "binary"] = "continuous",
    scaling: Literal["running", "none"] = "running",
) -> Composed:
    """A posing or reaching task of MyoSuite, as a composed task on its own model: the same observations, rewards and
    ends of episodes, stepped by `BodyBatch` for all seeds together.

    It needs the extra `myosuite`. What MyoSuite draws by its own generator, targets and starting poses, is drawn from
    the same distributions. Metrics are `solved`, whether the body is within the tolerance; and `success`, whether it
    was at more than five decisions of an episode, as MyoSuite's evaluator counts.

    **Arguments:**

    - `env_id`: such as `"myoFingerPoseRandom-v0"`. `myosuite_ids()` has all that can be rebuilt; others are Gymnasium
      environments, `from_gymnasium`.
    - `actions`: `"continuous"` for numbers in [−1, 1], as in MyoSuite; `"binary"` for muscles that are on or off, 1 or
      −1.
    - `scaling`: scaling of observations, as in `Composed`: `"none"` for MyoSuite's own.

    **Raises:** `ValueError` for an environment that does not exist or cannot be rebuilt, and where MyoSuite is missing.

    ```py
    task = mg.tasks.myosuite("myoElbowPose1D6MRandom-v0")
    run = mg.train(task, steps=20_000, seeds=10)
    ```
    """
    known = myosuite_ids()
    if env_id not in known:
        raise unknown("posing or reaching task of MyoSuite", env_id, known)
    import gymnasium

    given = environment(env_id)
    spec = gymnasium.spec(env_id)
    period = float(given.frame_skip * given.model.opt.timestep)
    terms = _posing(given) if str(spec.entry_point).endswith(POSING) else _reaching(given, period)
    return compose(
        Mjcf(f"myosuite:{env_id}"),
        **terms,
        actions=actions,
        scaling=scaling,
        action_period=period,
        time_limit=None if spec.max_episode_steps is None else spec.max_episode_steps * period,
        commands="sigmoid",
    )


def myosuite_ids() -> list[str]:
    """The ids of MyoSuite's environments that `myosuite` rebuilds: of those that pose or reach with an arm, hand or
    finger all but the ones that change the model in every episode, or the muscles.

    **Raises:** `ValueError` where MyoSuite is missing.
    """
    import gymnasium

    return [
        name
        for name in ids()
        if str(gymnasium.spec(name).entry_point).endswith((POSING, REACHING))
        and not name.startswith(VARIANTS)
        and gymnasium.spec(name).kwargs.get("weight_bodyname") is None
    ]


def _posing(given: Any) -> dict[str, Any]:
    weights = given.rwd_keys_wt
    tolerance = float(given.pose_thd)
    drawn = given.target_type == "generate"
    low, high = (_numbers(given._target_jnt_range[:, end]) for end in (0, 1)) if drawn else (None, None)
    # MyoSuite gives the target of a posing task by the positions of all joints
    target = Pose(low=low, high=high) if drawn else Pose(at=_numbers(given.target_jnt_value))
    reward = {
        "pose": [Distance(weight=-weights.get("pose", 0.0))],
        "bonus": [Within(tolerance=wide * tolerance, weight=weights.get("bonus", 0.0)) for wide in (1.0, 1.5)],
        "penalty": [Beyond(limit=FAR, weight=-weights.get("penalty", 0.0))],
        "act_reg": [Effort("activation", root=True, weight=-weights.get("act_reg", 0.0))] if given.model.na else [],
    }
    return {
        **_common(given),
        "targets": [target],
        "observe": _observed(given, {"pose_err": TargetError()}),
        "reward": [term for terms in reward.values() for term in terms],
        "terminate": [Beyond(limit=FAR, above=0.5)],
        "metrics": _metrics(tolerance),
    }


def _reaching(given: Any, period: float) -> dict[str, Any]:
    weights, ranges = given.rwd_keys_wt, given.target_reach_range
    parts = tuple(ranges)
    near = NEAR * len(parts)
    lost = float(given.far_th) * len(parts)
    low, high = (_numbers(np.concatenate([np.ravel(box[end]) for box in ranges.values()])) for end in (0, 1))
    box: dict[str, Any] = {"at": low} if low == high else {"low": low, "high": high}
    target = Reach(parts, **box, reachable=given.target_sampling == "workspace")
    # a rounding error of MuJoCo's clock decides whether the last decision of the grace is over it
    after = period * (GRACE if _elapsed(given) > GRACE * period else GRACE + 1)
    penalty = weights.get("penalty", 0.0)
    return {
        **_common(given),
        "targets": [target],
        "observe": _observed(given, {"tip_pos": Positions(parts), "reach_err": TargetError()}),
        "reward": [
            Distance(weight=-weights.get("reach", 0.0)),
            *(Within(tolerance=wide * near, weight=weights.get("bonus", 0.0)) for wide in (2.0, 1.0)),
            Beyond(limit=lost, after=after, weight=-penalty),
        ],
        "terminate": [Beyond(limit=lost, after=after, above=0.5)],
        "metrics": _metrics(near),
    }


def _elapsed(given: Any) -> float:
    """MuJoCo's clock after the last decision of the grace."""
    clock = 0.0
    for _ in range(GRACE * given.frame_skip):
        clock += given.model.opt.timestep
    return clock


def _common(given: Any) -> dict[str, Any]:
    if getattr(given, "reset_type", "init") == "random":
        return {"reset": [RandomJoints()]}
    start = _numbers(given._init_qpos)
    return {"reset": [RandomJoints(low=start, high=start)]}


def _observed(given: Any, own: dict[str, Any]) -> list[Any]:
    period = float(given.model.opt.timestep * given.frame_skip)
    terms = {"qpos": JointPositions(), "qvel": JointVelocities(scale=period), **own, "act": Activations()}
    return [terms[key] for key in given.obs_keys]


def _metrics(tolerance: float) -> list[Any]:
    return [Within(tolerance=tolerance, name="solved"), Success(tolerance=tolerance, name="success")]


def _numbers(array: Iterable[float]) -> tuple[float, ...]:
    return tuple(map(float, array))
