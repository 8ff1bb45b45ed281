"""Bad values in every field of every part of a scenario: one table, made from the annotations of the fields."""

from __future__ import annotations

import dataclasses
import typing

import numpy as np
import pytest

import ikgym
from ikgym.exceptions import IkgymError
from ikgym.plant import Plant
from ikgym.trajectories import (
    KINDS,
    AlongPath,
    FixedOrientation,
    Helix,
    JointSpline,
    OrientationThrough,
    PathTrajectory,
    PublishedPath,
    Quintic,
    RandomJointSpline,
    RandomPublishedPath,
    RandomSinusoid,
    Sinusoid,
    StraightLine,
    TimedWaypoints,
    Trapezoidal,
    Turning,
    paths,
)
from ikgym.trajectories.orientations import ORIENTATIONS
from ikgym.trajectories.paths import PATHS
from ikgym.trajectories.time_laws import TIME_LAWS

FRAME = [*np.eye(3).ravel(), 1.0, 0.0, 0.0]
ARM = ikgym.arms.get("panda")
ONES = np.ones(7)
SPLINE = RandomJointSpline(-ONES, ONES, ONES / 3, ONES, 2.0)
QUATERNIONS = [[1.0, 0, 0, 0], [0.8, 0.6, 0, 0], [0.6, 0.8, 0, 0]]
LINE = paths.Line([0, 0, 0], [1, 2, 3])
GOOD = (
    ARM,
    ikgym.scenarios.get("panda-line").replace(velocity_limit=np.full(7, 2.0), start=ARM.home, initial_pose=FRAME),
    ikgym.TrackingCost(),
    Plant(zero=1e-3, bandwidth=10.0, command_delay=2, arms=(ARM,)),
    Sinusoid(0.1 * ONES, frequency=ONES, phase=ONES / 3, offset=ONES, sigmoid=0.7),
    RandomSinusoid(0.1 * ONES),
    SPLINE,
    SPLINE.sample(np.random.default_rng(0)),
    Helix([0, 0, 0], 1.0, 1.0, 1.0),
    StraightLine(FRAME, FRAME, 1.0, 0.5),
    TimedWaypoints([0.0, 1.0, 2.0], np.eye(3), QUATERNIONS),
    PathTrajectory(LINE, Quintic(1, 1), FixedOrientation(np.eye(3))),
    PublishedPath("rlitg-zig", 0.2),
    RandomPublishedPath("rlitg-random-00", 0.2),
    LINE,
    paths.Circle([0, 0, 0], 0.3),
    paths.CircularHelix([0, 0, 0], 0.3, pitch=0.1),
    paths.Lemniscate([0, 0, 0], 0.3),
    paths.Square([0, 0, 0], 0.3, 0.01),
    paths.Raster([0, 0, 0], 0.3, 0.2, 4, 0.01),
    paths.Polyline(np.eye(3), 0.01),
    paths.SplinePath(np.eye(3)),
    Quintic(1.0, 1.0, 90.0),
    Trapezoidal(1.0, 1.0, 90.0),
    FixedOrientation(np.eye(3)),
    AlongPath(),
    Turning(np.eye(3), [0.0, 0.0, 1.0]),
    OrientationThrough(QUATERNIONS),
)
#: Fields for which one of the values below is good: infinite limits, texts that are kept as they are.
ALLOWED = {
    ("Arm", field): ("none", "inf", "huge") for field in ("lower", "upper", "velocity_limit", "acceleration_limit")
} | {
    ("Scenario", "velocity_limit"): ("none",),
    ("Scenario", "model"): ("none",),
    ("Plant", "bandwidth"): ("inf",),
    ("RandomSinusoid", "amplitude"): ("longer",),
    ("JointSpline", "control"): ("longer",),
    ("OrientationThrough", "quaternions"): ("longer",),
}


def bad_values(value, hint) -> dict[str, object]:
    """Values that no field with such a good value takes."""
    optional = type(None) in typing.get_args(hint)
    out: dict[str, object] = {} if optional or value is None else {"none": None}
    if isinstance(value, str):
        return out | {"number": 3, "list": ["x"]}
    out |= {"text": "x", "object": object(), "complex": 1j}
    if isinstance(value, (bool, int)) and not isinstance(value, float):
        return out | {"fraction": 1.5, "nan": np.nan, "list": [[1]], "truth": True, "negative": -1}
    if isinstance(value, float):
        return out | {"nan": np.nan, "inf": np.inf, "list": [[1.0]], "huge": 10**400}
    if isinstance(value, (np.ndarray, tuple)) and len(value) and isinstance(np.ravel(value)[0], (float, np.floating)):
        array = np.array(value)
        changed = {"nan": np.nan, "inf": np.inf, "huge": 1e300}
        return out | {
            "longer": np.concatenate([array, array[-1:]]),
            "deeper": [array, array],
            **{
                name: np.where(np.arange(array.size).reshape(array.shape) == 0, x, array) for name, x in changed.items()
            },
        }
    return out


CASES = [
    pytest.param(one, field.name, bad, id=f"{type(one).__name__}.{field.name}={name}")
    for one in GOOD
    for field in dataclasses.fields(one)
    if field.init
    for name, bad in bad_values(getattr(one, field.name), typing.get_type_hints(type(one))[field.name]).items()
    if name not in ALLOWED.get((type(one).__name__, field.name), ())
]


@pytest.mark.parametrize(("good", "field", "bad"), CASES)
def test_a_bad_value_is_refused_in_one_line(good, field, bad):
    with pytest.raises(IkgymError) as caught:
        good.replace(**{field: bad})
    assert len(str(caught.value).splitlines()) == 1
    assert len(str(caught.value)) < 4000


def test_every_kind_of_part_is_in_the_table():
    kinds = {*KINDS.values(), *PATHS.values(), *TIME_LAWS.values(), *ORIENTATIONS.values()}
    assert kinds == {type(one) for one in GOOD} - {ikgym.Arm, ikgym.Scenario, ikgym.TrackingCost, Plant}
    assert {JointSpline, ikgym.Scenario} <= {type(one) for one in GOOD}
