"""Parts of scenarios: their copies, bad input by a table of fields and values, and by a table of calls."""

import copy
import dataclasses
import functools
import pickle
import re
import typing
from types import SimpleNamespace

import numpy as np
import pytest

import ikgym
import ikgym.rl
import ikgym.sb3
from ikgym.arms.bodies import MOST_BODIES, Bodies
from ikgym.exceptions import IkgymError
from ikgym.frozen import Frozen
from ikgym.obstacles import KINDS as OBSTACLES
from ikgym.obstacles import MOST_OBSTACLES, Box, Capsule, HalfSpace, RandomBoxes, Sphere
from ikgym.plant import Plant
from ikgym.trajectories import (
    KINDS,
    AlongPath,
    FixedOrientation,
    Helix,
    JointPath,
    JointSpline,
    OrientationThrough,
    PathTrajectory,
    PublishedPath,
    Quintic,
    RandomJointSpline,
    RandomPublishedPath,
    RandomSinusoid,
    RetimedTrajectory,
    Sinusoid,
    StraightLine,
    TimedWaypoints,
    Trapezoidal,
    Turning,
    paths,
    through,
)
from ikgym.trajectories.orientations import ORIENTATIONS
from ikgym.trajectories.paths import PATHS
from ikgym.trajectories.time_laws import TIME_LAWS
from ikgym.validation import Bounds, Flag
from tests.comparison import fields, identical

FRAME = [*np.eye(3).ravel(), 1.0, 0.0, 0.0]
ARM = ikgym.arms.get("panda")
ONES = np.ones(7)
SPLINE = RandomJointSpline(-ONES, ONES, ONES / 3, ONES, 2.0)
QUATERNIONS = [[1.0, 0, 0, 0], [0.8, 0.6, 0, 0], [0.6, 0.8, 0, 0]]
LINE = paths.Line([0, 0, 0], [1, 2, 3])
HELIX = Helix([0, 0, 0], 1, 1, 1)
BODIES = Bodies(("upper", "hand"), (3, 7), [[0, 0, 0], [0, 0, -0.1]], [[0, 0, 0.1], [0, 0, -0.1]], (0.1, 0.05))
RETIMED = RetimedTrajectory(PathTrajectory(LINE, Quintic(1, 1)), [0.0, 2.0], [0.0, 1.0], [0.0, 1.0])
JOINT_PATH = JointPath(RETIMED, [0.0, 1.0], [[0.0] * 7, [1.0] * 7])
BOXES = RandomBoxes("boxes", [-1, -1, 0], [1, 1, 1], [0.1, 0.1, 0.1], [0.2, 0.2, 0.2], ignored=("hand",))
GOOD = (
    ARM,
    BODIES,
    Sphere("sphere", [1, 0, 0], 0.1, motion=HELIX, ignored=("hand",)),
    Capsule("capsule", [1, 0, 0], [1, 0, 1], 0.1, motion=HELIX, ignored=("hand",)),
    Box("box", [1, 0, 0], [0.1, 0.2, 0.3], np.eye(3), motion=HELIX, ignored=("hand",)),
    HalfSpace("floor", [0, 0, 0], [0, 0, 1], motion=HELIX, ignored=("hand",)),
    BOXES,
    ikgym.scenarios.get("panda-line").replace(velocity_limit=np.full(7, 2.0), start=ARM.home, initial_pose=FRAME),
    ikgym.TrackingCost(),
    ikgym.ProximityCost(0.1),
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
    RETIMED,
    JOINT_PATH,
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
    ("Arm", field): ("none", "inf", "huge")
    for field in ("lower", "upper", "velocity_limit", "acceleration_limit", "jerk_limit")
} | {
    ("Scenario", "velocity_limit"): ("none",),
    ("Scenario", "jerk_limit"): ("none", "inf", "huge"),
    ("Scenario", "model"): ("none",),
    ("Scenario", "steps"): ("none",),
    ("Scenario", "policy"): ("text",),
    ("Plant", "bandwidth"): ("inf",),
    ("Plant", "resonance"): ("inf",),
    ("Plant", "command_delay"): ("fraction",),
    ("Bodies", "ends"): ("none",),
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


def refusal(call):
    """The message of the error that a call raises."""
    try:
        call()
    except IkgymError as error:
        return str(error)
    return ""


@pytest.mark.parametrize("good", GOOD, ids=lambda one: type(one).__name__)
def test_bad_values_of_fields_are_refused_in_one_line(good):
    kind, hints = type(good).__name__, typing.get_type_hints(type(good))
    for field in (field.name for field in dataclasses.fields(good) if field.init):
        for name, bad in bad_values(getattr(good, field), hints[field]).items():
            if name in ALLOWED.get((kind, field), ()):
                continue
            said = refusal(functools.partial(good.replace, **{field: bad}))
            assert said, f"{kind} takes {field}={name}"
            assert len(said.splitlines()) == 1
            assert len(said) < 4000


@pytest.mark.parametrize("good", GOOD, ids=lambda one: type(one).__name__)
def test_copies_are_the_same_bit_for_bit_and_never_change(good):
    given = {name: np.array(value) for name, value in good._fields().items() if isinstance(value, np.ndarray)}
    changed = good.replace(**given)
    for array in given.values():
        array[...] = 0.0
    for other in (changed, pickle.loads(pickle.dumps(good)), copy.deepcopy(good)):
        assert identical(fields(other), fields(good))
        public = [value for name, value in vars(other).items() if name[0] != "_"]
        arrays = [one for value in public for one in (value if isinstance(value, tuple) else [value])]
        assert not any(one.flags.writeable for one in arrays if isinstance(one, np.ndarray))


def test_a_class_of_ones_own_may_have_annotations_that_nobody_knows():
    @dataclasses.dataclass(frozen=True, eq=False)
    class Heavy(Sphere):
        weight: "Kilograms | None" = None  # noqa: F821

    @dataclasses.dataclass(frozen=True, eq=False)
    class Renamed(Sphere):
        colour: typing.Annotated[float, "from 0 to 1"] = 0.5
        nothing: None = None

    for kind in (Heavy, Renamed):
        assert kind("a", [0, 0, 0], 1).radius == 1.0
        with pytest.raises(IkgymError, match="radius"):
            kind("a", [0, 0, 0], -1.0)


@pytest.mark.parametrize(
    ("bad", "message"),
    [
        ({"count": 0}, "count: expected a whole number of at least 1, got 0"),
        ({"count": None}, "count: expected a whole number"),
        ({"share": 1.5}, r"share: expected a finite number from 0 to 1, got 1\.5"),
        ({"way": "lft"}, "choice 'lft' of way. Did you mean 'left'"),
        ({"timed": "al"}, "choice 'al' of timed. Did you mean 'all'"),
        ({"timed": 0}, "timed: expected a whole number of at least 1, got 0"),
        ({"twice": 1}, "twice: expected true or false, got 1"),
    ],
)
def test_annotations_are_checks_and_hold_in_subclasses(bad, message):
    @dataclasses.dataclass(frozen=True)
    class Base(Frozen):
        count: typing.Annotated[int, Bounds(at_least=1)] = 1
        share: typing.Annotated[float, Bounds(at_least=0.0, at_most=1.0)] | None = None
        way: typing.Literal["left", "right"] = "left"
        timed: typing.Annotated[int | typing.Literal["all"], "for a reader", Bounds(at_least=1)] = "all"
        twice: Flag = False

    @dataclasses.dataclass(frozen=True)
    class Derived(Base):
        count: int = 3

    assert Derived(share=1, timed=2) == Derived(3, 1.0, "left", 2, False)
    with pytest.raises(IkgymError, match=message):
        Derived(**bad)


def test_every_kind_of_part_is_in_the_table():
    kinds = {kind for family in (KINDS, PATHS, TIME_LAWS, ORIENTATIONS, OBSTACLES) for kind in family.values()}
    costs = {ikgym.TrackingCost, ikgym.ProximityCost}
    assert kinds == {type(one) for one in GOOD} - {ikgym.Arm, Bodies, ikgym.Scenario, Plant} - costs
    assert {JointSpline, ikgym.Scenario} <= {type(one) for one in GOOD}


PANDA_LINE = ikgym.scenarios.get("panda-line")
FAST = ikgym.scenarios.get("varga7-fast")
PLANE = {"a": [1], "d": [0], "alpha": [0]}
POINTS = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0]])
STRAIGHT_BACK = [[0, 0, 0], [1, 0, 0], [0, 0, 0]]
VARGA, SKEW = ikgym.arms.get("varga7"), ikgym.tasks.get("skew")
TWO = ikgym.Arm("two", [[0, 0, 1], [1, 0, 0]], [[0, 0, 1], [1, 0, 0]], (False, True))
LAW = {"speed": 1.0, "acceleration": 1.0}
PUBLISHED = ikgym.scenarios.get("rlitg-random")
TRACK = "ikgym/Track-v0"


def reset(scenario="varga7-random", /, **options):
    ikgym.RedundantIKEnv(scenario).reset(seed=0, options=options)


def reset_rows(seed=0, /, **options):
    ikgym.RedundantIKVectorEnv(2, "varga7-random").reset(seed=seed, options=options)


def inverse(**changes):
    ARM.inverse(**{"rotation": np.eye(3), "position": np.array([0.4, 0, 0.4])} | changes)


def dh(**changes):
    ikgym.arms.from_dh("one", **PLANE | changes)


def around(*obstacles, bodies=BODIES, **changes):
    return PANDA_LINE.replace(arm=ARM.replace(bodies=bodies), obstacles=obstacles, **changes)


#: What a call refuses, by a word that its message names: values that do not go together, and arguments of methods.
REFUSED = [
    *(("axes.*unit vector", lambda x=x: TWO.replace(axes=[x, [1, 0, 0]])) for x in ([0, 0, 0], [1, 1, 0])),
    ("at least one joint", lambda: ikgym.Arm("none", np.zeros((0, 3)), np.zeros((0, 3)))),
    ("prismatic", lambda: TWO.replace(prismatic=(0, 1))),
    ("tool_rotation", lambda: TWO.replace(tool_rotation=np.diag([1, 1, -1]))),
    ("lower < upper", lambda: TWO.replace(lower=[0, 2], upper=[1, 2])),
    ("velocity_limit", lambda: TWO.replace(velocity_limit=[1, 0])),
    ("home", lambda: TWO.replace(upper=[1, 2], home=[0, 3])),
    *(("joint_names", lambda x=x: TWO.replace(joint_names=x)) for x in ("ab", ("a", "a"))),
    ("Did you mean 'tool'", lambda: TWO.replace(tools=1)),
    *(("q: expected", lambda x=x: TWO.forward(x)) for x in (0.0, [1.0], [0, np.nan], ["0", "0"], [1j, 0], None)),
    ("link of body 'upper'.*from 0, the base, to 2, the last, got 3", lambda: TWO.replace(bodies=BODIES)),
    ("'two': bodies.*Bodies", lambda: TWO.replace(bodies=())),
    *((word, lambda field=field, x=x: BODIES.replace(**{field: x})) for word, field, x in (
        ("radii of bodies.*at least 1e-12, got -0.1 as number 1", "radii", (0.1, -0.1)), ("radii", "radii", (0.1,)),
        ("radii.*finite", "radii", (0.1, np.nan)), ("starts.*finite", "starts", np.full((2, 3), np.nan)),
        ("starts.*shape", "starts", np.zeros(6)), ("ends.*shape", "ends", np.zeros((3, 3))), ("links", "links", (1,)),
        ("links", "links", (1, -1)), ("different texts", "names", ("hand", "hand")), ("names", "names", "ab"),
        ("names", "names", ("a", "")), ("at most 1000, got 1001", "names", tuple(map(str, range(MOST_BODIES + 1)))),
        ("two names each", "ignored", ("hand", "upper")), ("two names each", "ignored", (("hand", 1),)),
        ("Did you mean 'hand'", "ignored", (("hnad", "upper"),)),
    )),
    ("different texts", lambda: BODIES.added("hand", 1, [0, 0, 0], radius=0.1)),
    ("start of body 'new'", lambda: BODIES.added("new", 1, [0, 0], radius=0.1)),
    ("'a': radius", lambda: Sphere("a", [0, 0, 0], 0.0)),
    ("'a': size", lambda: Box("a", [0, 0, 0], [1, 0, 1])),
    ("'a': rotation", lambda: Box("a", [0, 0, 0], [1, 1, 1], np.diag([1, 1, -1]))),
    ("'a': normal", lambda: HalfSpace("a", [0, 0, 0], [0, 0, 0])),
    ("name: expected a text", lambda: Sphere("", [0, 0, 0], 1.0)),
    ("not random", lambda: Sphere("a", [0, 0, 0], 1.0, motion=SPLINE)),
    ("names of bodies", lambda: Sphere("a", [0, 0, 0], 1.0, ignored="hand")),
    ("'hand' and 'a'.*mm.*`ignored`", lambda: reset(around(Sphere("a", [0.4, 0, 0.5], 0.5, ignored=("upper",))))),
    ("'hand' and 'upper'.*`ignored`", lambda: reset(around(bodies=BODIES.replace(radii=(0.1, 1.0)), collisions=True))),
    ("'a' twice", lambda: around(*2 * [Sphere("a", [9, 0, 0], 0.1)])),
    ("'hand' twice", lambda: around(Sphere("hand", [9, 0, 0], 0.1))),
    (f"at most {MOST_OBSTACLES}, got 1000000", lambda: around(*10**6 * [Sphere("a", [9, 0, 0], 0.1)])),
    ("list of obstacles", lambda: PANDA_LINE.replace(obstacles=Sphere("a", [9, 0, 0], 0.1))),
    ("list of obstacles", lambda: around("a")),
    ("Did you mean 'hand'", lambda: around(Sphere("a", [9, 0, 0], 0.1, ignored=("hnad",)))),
    ("an arm with bodies, 'panda' has none", lambda: around(Sphere("a", [9, 0, 0], 0.1), bodies=Bodies())),
    ("an arm with bodies, 'panda' has none", lambda: around(bodies=Bodies(), collisions=True)),
    *(("collisions", lambda x=x: around(collisions=x)) for x in (1, "yes", np.nan)),
    ("with collisions, got one without", lambda: PANDA_LINE.replace(proximity=ikgym.ProximityCost(0.1))),
    ("proximity.*ProximityCost", lambda: around(Sphere("a", [9, 0, 0], 0.1), proximity=0.1)),
    ("cost of at most", lambda: around(Sphere("a", [9, 0, 0], 0.1), proximity=ikgym.ProximityCost(1, 1e-12, 100))),
    *(("distance", lambda x=x: ikgym.ProximityCost(0.1).value(x)) for x in (np.nan, [np.inf], "a", None)),
    ("'one': d: expected", lambda: dh(a=[1, 2])),
    ("alpha", lambda: dh(alpha=[np.nan])),
    ("row", lambda: dh(a=[], d=[], alpha=[])),
    ("prismatic", lambda: dh(prismatic=(True, True))),
    *(("rotation", lambda x=x: inverse(rotation=x)) for x in (np.eye(4), 2 * np.eye(3), np.full((3, 3), np.nan), "up")),
    *(("position", lambda x=x: inverse(position=x)) for x in ([0.1, 0.2], [0.1, 0.2, np.inf])),
    *(("start", lambda x=x: inverse(start=x)) for x in (np.zeros(6), np.zeros(7))),
    ("fit together", lambda: inverse(position=np.zeros((2, 3)), start=np.tile(ARM.home, (3, 1)))),
    *((name, lambda name=name: inverse(**{name: -1})) for name in ("tolerance", "restarts", "seed")),
    ("Did you mean 'skew'", lambda: ikgym.tasks.get("skwe")),
    ("rotation", lambda: SKEW.coordinates(np.zeros(3), np.zeros(3))),
    ("rotation", lambda: SKEW.coordinates(np.eye(3), np.zeros((2, 3)))),
    ("nominal", lambda: SKEW.error(np.zeros(5), np.zeros(6))),
    ("coordinates", lambda: SKEW.error(np.zeros((4, 6)), np.zeros((3, 6)))),
    ("coordinates", lambda: SKEW.error(np.zeros(6), np.full(6, np.nan))),
    ("jacobian", lambda: SKEW.jacobian(np.eye(3), np.zeros((5, 7)))),
    *(("jacobian: expected shape", lambda x=x: SKEW.error_jacobian(np.zeros((2, 6)), np.zeros((2, 6)), x)) for x in (
        3.0, np.zeros((6, 7)),
    )),
    *(("error", lambda x=x: ikgym.TrackingCost().tracking(x)) for x in (np.nan, [np.inf, 0], "a", [], 1.0, [None])),
    ("duration", lambda: PathTrajectory(LINE, Trapezoidal(0.5, 2.0, 2.0))),
    ("approach", lambda: AlongPath([0, 0, 0])),
    ("approach", lambda: PathTrajectory(paths.Circle([0, 0, 0], 1.0), Quintic(1, 1), AlongPath([1, 0, 0]))),
    ("of length 1.41421", lambda: OrientationThrough([[1, 0, 0, 0], [1, 1, 0, 0]])),
    ("half a turn", lambda: OrientationThrough([[1, 0, 0, 0], [0, 1, 0, 0]])),
    ("quaternions", lambda: PathTrajectory(LINE, Quintic(1, 1), OrientationThrough(QUATERNIONS))),
    ("from 2 to", lambda: paths.SplinePath([[0, 0, 0]])),
    ("apart", lambda: paths.SplinePath([[1, 0, 0], [0, 0, 0], [0, 0, 0]])),
    *(("straight back", lambda make=make: make()) for make in (
        lambda: paths.SplinePath(STRAIGHT_BACK), lambda: paths.Polyline(STRAIGHT_BACK, 0.1),
    )),
    *((word, lambda field=field, x=x: BOXES.replace(**{field: x})) for word, field, x in (
        ("'boxes': count", "count", 10**6), ("lower <= upper", "lower", [0, 0, 2]),
        ("smallest.*at least 1e-12", "smallest", [0, 0.1, 0.1]), ("'boxes': within", "within", 0.01),
    )),
    *((word, lambda field=field, x=x: RETIMED.replace(**{field: x})) for word, field, x in (
        ("rise, got 0", "times", [0, 0]), ("0 s as the first, got 1", "times", [1, 2]), ("from 2 to", "times", [0]),
        ("never fall, got -1", "progress", [1, 0]), ("at least 0, got -1", "rates", [0, -1]),
        ("not random", "trajectory", RandomSinusoid(ONES)),
    )),
    *(("rise, got 0|0 s as the first|shape", lambda x=x: JOINT_PATH.replace(**x)) for x in (
        {"times": [0.0, 0.0]}, {"times": [0.1, 1.0]}, {"q": [[0.0] * 7]},
    )),
    ("start and end", lambda: paths.Line([1, 2, 3], [1, 2, 3])),
    *(("corner_radius|at most 1 m", lambda x=x: paths.Polyline(POINTS, x)) for x in (2.0, 0.0)),
    ("corner_radius", lambda: paths.Square([0, 0, 0], 0.1, 0.06)),
    ("corner_radius", lambda: paths.Raster([0, 0, 0], 1.0, 0.3, 4, 0.1)),
    ("lines", lambda: paths.Raster([0, 0, 0], 1.0, 1.0, 1, 0.1)),
    ("lower < upper", lambda: RandomJointSpline([0, 1], [1, 0], 1, 1, 1)),
    ("upper", lambda: RandomJointSpline([0, 1], [1], 1, 1, 1)),
    ("velocity_limit", lambda: RandomJointSpline([0], [1], 0, 1, 1)),
    *((name, lambda name=name, x=x: SPLINE.replace(**{name: x})) for name, x in (
        ("spans", 2), ("spans", 200_000_000), ("margin", 1.0), ("scale", (0.5, 1.5)),
    )),
    ("lower", lambda: RandomJointSpline.within(VARGA, 2.0)),
    ("feasible", lambda: PANDA_LINE.replace(trajectory=SPLINE.replace(velocity_limit=3 * ONES))),
    *(("sample one first", lambda x=x: x.frames(np.zeros(1), ARM)) for x in (SPLINE, RandomSinusoid(ONES))),
    ("control", lambda: JointSpline(np.zeros((5, 7)), 1.0)),
    ("the same", lambda: JointSpline(np.arange(8.0)[:, None], 1.0)),
    ("phase", lambda: Sinusoid([1, 2], phase=[1, 2, 3])),
    ("scale", lambda: RandomSinusoid([1.0], scale=(1.0, 0.2))),
    ("half of the duration", lambda: StraightLine(FRAME, FRAME, 1.0, 0.6)),
    ("rotation of end", lambda: StraightLine(FRAME, np.zeros(12), 1.0, 0.5)),
    ("speed", lambda: through(POINTS)),
    ("acceleration", lambda: through(POINTS, speed=1.0)),
    ("speed", lambda: through(POINTS, times=[0, 1, 2], speed=1.0)),
    ("positions", lambda: through(POINTS, times=[0, 1])),
    ("quaternions|shape", lambda: through(POINTS, QUATERNIONS[:2], times=[0, 1, 2])),
    ("orientation", lambda: through(POINTS, QUATERNIONS, orientation=FixedOrientation(np.eye(3)), **LAW)),
    ("Did you mean 'quintic'", lambda: through(POINTS, time_law="quintik", **LAW)),
    ("Did you mean", lambda: PublishedPath("rlitg-helo", 0.2)),
    ("period", lambda: PublishedPath("rlitg-hello", 0.0)),
    *(("family|starts", lambda x=x: RandomPublishedPath(x, 0.2)) for x in ("none", "cppflow")),
    ("8 joints", lambda: PUBLISHED.replace(arm=ikgym.arms.get("fetch"))),
    ("Did you mean 'rlitg-hello'", lambda: ikgym.problems.get("rlitg-helo")),
    *((name, lambda name=name, x=x: Plant(**{name: x})) for name, x in (
        *((name, -1.0) for name in ("zero", "link", "axis", "backlash", "noise", "q_noise", "pose_noise")),
        ("payload", np.inf), ("payload_step", 2.5), ("bandwidth", 0.0), ("bandwidth", (20, 10)),
        ("bandwidth", (10, np.inf)), ("bandwidth", (1, 0, 3)), ("command_delay", (1, -1, 2)), ("gain", 0.0),
        ("resonance", 0.0), ("resonance", (1, -2, 3)), ("resonance", [[1.0, 2.0], [3.0]]), ("resonance", ()),
        *((name, ()) for name in ("bandwidth", "command_delay", "gain", "resonance_damping")),
        ("resonance_damping", 1.0), ("drive", (1, 0, 0)), ("drive", (1.1, 0, 0, 1, 0, 0, 0)),
        ("command_delay", (12, 2)), ("command_delay", (1.5, 2)), ("delay_margin", -1.0), ("delay_margin", (1, 2)),
        ("q_delay", 0.5), ("pose_every", 0), ("pose_every", (0, 2)), ("pose_noise", (2, 1)), ("calibration", -1.0),
        ("from_middle", (0.5, 0.5)), ("from_middle", 0.5), ("from_middle", (0, 2)), ("pose_missing", 1.01),
        ("arms", "panda-2"), ("arms", ("panda-2",)),
    )),
    *((name, lambda name=name, x=x: FAST.replace(steps=20, plant=Plant(**{name: x}))) for name, x in (
        ("zero", (1.0, 2.0)), ("bias", (1.0, 2.0)), ("bandwidth", (1.0, 2.0, 3.0)), ("command_delay", (1, 2, 3)),
        ("resonance", (1.0, 2.0)), ("gain", (1.0, 2.0)), ("drive", ((0, 0, 0, 1, 0, 0, 0),) * 3),
        ("command_delay", (3, 21)), ("q_delay", 21), ("pose_delay", 21),
        ("arms", (ikgym.arms.get("faitli3"),)), ("arms", (ARM,)),
    )),
    ("knowledge", lambda: Plant(zero=1e-3).scaled(-0.1)),
    ("drives", lambda: Plant(zero=1e-3).scaled(1.0, np.nan)),
    ("pose_missing", lambda: Plant(pose_missing=0.5).scaled(3.0)),
    ("arms", lambda: Plant(arms=(ARM,)).scaled(0.5)),
    *((name, lambda name=name, x=x: FAST.replace(**{name: x})) for name, x in (
        ("velocity_limit", 0.0), ("velocity_limit", [1.0, 2.0]), ("iterations_per_point", (3, 0)), ("arm", "varga7"),
    )),
    ("7 joints", lambda: FAST.replace(model=ikgym.arms.get("faitli3"))),
    ("7 joints", lambda: FAST.replace(trajectory=Sinusoid([1.0, 2.0]))),
    ("orientations", lambda: FAST.replace(trajectory=HELIX, start=np.zeros(7))),
    ("seed", lambda: ikgym.scenarios.get("varga7-random").nominal()),
    *(("preview", lambda x=x: FAST.nominal(preview=x)) for x in (-1, 1.5, "a", (1, -2))),
    ("same at every reset", lambda: ikgym.scenarios.gaps(ikgym.scenarios.get("panda-random"))),
    ("poses", lambda: ikgym.scenarios.gaps(PANDA_LINE, 1)),
    *(("preview", lambda x=x: ikgym.RedundantIKEnv(preview=x)) for x in (
        0, -1, True, 1.5, (), (0, 1), (3, 2), (2, 2), "2", (1, 2.5), None, 2**40, (1, 2**40),
    )),
    *(("commands", lambda x=x: ikgym.RedundantIKEnv(commands=x)) for x in (-1, 1.5, "a")),
    ("render_mode", lambda: ikgym.RedundantIKEnv(render_mode="ansi")),
    *(("step", lambda x=x: reset(step=x)) for x in (1000, -1, 1.5, [1, 2])),
    ("path of the tool", lambda: reset("panda-circle", step=1)),
    ("arm_seed", lambda: reset(arm_seed=3)),
    *(("arm_seed", lambda x=x: reset("panda-camera", arm_seed=x)) for x in (-1, 1.5, [1, 2], "x")),
    *(("Boolean|true entry", lambda x=x: reset_rows(reset_mask=x)) for x in (
        [True, False], np.ones(2), np.ones(3, dtype=bool), np.zeros(2, dtype=bool),
    )),
    *(("'q'", lambda x=x: reset_rows(q=x)) for x in (np.zeros(6), np.full(7, np.inf))),
    *(("seed", lambda x=x: reset_rows(x)) for x in ([1, 2, 3], 1.5)),
    ("Did you mean 'reset_mask'", lambda: reset_rows(resetmask=np.ones(2, dtype=bool))),
    ("Did you mean 'SameStep'", lambda: ikgym.RedundantIKVectorEnv(2, autoreset_mode="SamStep")),
    ("num_envs", lambda: ikgym.RedundantIKVectorEnv(0)),
    ("shows a single one", lambda: ikgym.RedundantIKVectorEnv(2, render_mode="human")),
    ("num_envs", lambda: ikgym.sb3.RedundantIKVecEnv(0)),
    ("ahead: expected rising times", lambda: ikgym.rl.make(FAST, ahead=(0.05, 0.01))),
    ("no field 'preview' of Task", lambda: ikgym.rl.make(FAST, preview=1)),
    ("expected an object of Task, got 'panda-random'", lambda: ikgym.rl.LearningEnv("panda-random")),
    ("expected an object of Task, got 'panda-random'", lambda: ikgym.rl.LearningVectorEnv(2, "panda-random")),
    ("lost_distance", lambda: ikgym.rl.make(FAST, lost_distanc=1.0)),
    ("drawn from ranges", lambda: ikgym.rl.make("learning-track", context=True)),
    *((name, lambda name=name, x=x: ikgym.rl.make(FAST, **{name: x})) for name, x in (
        ("lost_distance", 0.0), ("share", 0.0), ("radian", -1.0), ("half", 0.0), ("fine", 0.0), ("history", 0),
        ("counted", np.nan), ("counted", 0), ("radian", 1e300), ("radian", 1e-300), ("history", 10**9),
    )),
    *(("model: expected", lambda x=x: ikgym.rl.costs(x, TRACK, episodes=1)) for x in (
        3, None, "dls", SimpleNamespace(predict=1), SimpleNamespace(predict=lambda *_, **__: 0),
    )),
    *(("episodes", lambda x=x: ikgym.rl.costs(None, TRACK, episodes=x)) for x in ("two", 1.5, None, 10**12)),
    ("Did you mean", lambda: ikgym.rl.costs(None, "ikgym/Reach-v1")),
    *(("expected", lambda x=x: ikgym.rl.score(x)) for x in (3, None, [[1.0]], {TRACK: "costs"}, {TRACK: {}})),
    ("ikgym/Track-v0", lambda: ikgym.rl.score({"ikgym/Trak-v0": [[1.0]]})),
    (r"of shape \(seeds, episodes\), got \(2,\)", lambda: ikgym.rl.score({TRACK: [1.0, 2.0]})),
    ("at least 0", lambda: ikgym.rl.score({TRACK: [[-1.0]]})),
    ("from 1 to 256, got 257", lambda: ikgym.rl.score({TRACK: np.ones((1, 257))})),
    *(("Available: validation, test", lambda x=x: ikgym.rl.score({TRACK: [[1.0]]}, x)) for x in ("train", "x")),
    *(("expected a list of obstacles", lambda x=x: ARM.clearance(np.zeros(7), x)) for x in (5, "x", [5], None)),
]  # fmt: skip


@pytest.mark.parametrize(("word", "call"), [pytest.param(*case, id=f"{i}-{case[0]}") for i, case in enumerate(REFUSED)])
def test_calls_that_are_refused(word, call):
    said = refusal(call)
    assert re.search(word, said), said
    assert len(said.splitlines()) == 1
