"""Solvers of other projects: what they receive, what they keep, and what they say when they cannot."""

import importlib
import threading

import numpy as np
import pytest

import baselines
import ikgym
from baselines.episodes import rollout
from baselines.evaluate import evaluate
from baselines.registry import get
from baselines.solvers.rivals.base import turn
from baselines.status import Status
from ikgym.exceptions import InvalidInputError, MissingDependencyError
from ikgym.kernels.rotations import rodrigues
from tests.baselines.making import circle, made

RIVALS = [name for name in baselines.names() if get(name).rival]
#: ProxQP takes less than rounding for a solution unless it is asked for more.
EXACT = {"roboplan": {"tolerance": 1e-9}}
every_rival = pytest.mark.parametrize("name", RIVALS)


def observation(scenario, policy, q=None):
    env = ikgym.RedundantIKEnv(scenario, preview=policy.preview)
    return env.reset(seed=0, options=None if q is None else {"q": q})[0]


def exact(name, scenario):
    return made(name, scenario, **EXACT.get(name, {}))


def played(scenario, name):
    """An episode, and its steps in which a stop, the velocity and the acceleration limit held a joint back."""
    episode = rollout(scenario, exact(name, scenario), 0)
    return episode, (episode.at_limit > 0).sum(axis=0)


@every_rival
@pytest.mark.parametrize("task", ["matrix", "axis"])
def test_a_gentle_path_is_tracked_to_rounding(name, task):
    scenario = circle(task=task).replace(steps=200)
    if task not in get(name).tasks:
        with pytest.raises(InvalidInputError, match=rf"{name}: expected a scenario of the task .*'{task}'"):
            baselines.make(name, scenario)
        return
    episode, held = played(scenario, name)
    assert episode.position_error.max() < 1e-6
    assert not (episode.orientation_error > 1e-6).any()
    assert not held.any()


@pytest.mark.parametrize(
    ("name", "task"), [(name, task) for name in RIVALS for task in get(name).tasks if task != "matrix"]
)
def test_the_measured_pose_corrects_a_wrong_model(name, task):
    """The arm as it was built is millimetres off its nominal model, and holds an unknown tool."""
    built, base = ikgym.arms.get("panda-7"), ikgym.scenarios.get("panda-circle")
    tool = built.tool + 0.1 * built.tool_rotation[:, 2]
    turned = built.tool_rotation @ rodrigues(np.array([0.6, 0.0, 0.8]), 0.3 if task == "pose" else 0.0)
    scenario = base.replace(
        name="built",
        arm=built.replace(tool=tool, tool_rotation=turned),
        model=ikgym.arms.get("panda"),
        task=ikgym.tasks.get(task),
        steps=200,
    )
    (episode, _), (ours, _) = (played(scenario, one) for one in (name, "dls"))
    assert episode.position_error.max() < max(1e-5, 2.0 * ours.position_error.max())
    assert not (episode.orientation_error > 1e-4).any()


@every_rival
def test_programs_wait_for_a_slow_joint(name):
    """TIAGo's torso is slow: who knows of it lets the arm do the work. Actions may be slower than the arm."""
    program, held = played(circle("tiago", dt=4e-3), name)
    assert program.position_error.max() < 2e-5
    assert not held.any()
    slow = made(name, circle().replace(velocity_limit=0.1))
    np.testing.assert_array_equal(slow.model.velocity_limit, 0.1)


@every_rival
def test_stops_are_kept(name):
    """No joint may turn by more than 0.03 rad, which is not enough for the circle."""
    home = ikgym.arms.get("panda").home
    scenario = circle(lower=home - 0.03, upper=home + 0.03)
    (episode, held), (_, unaware) = (played(scenario, one) for one in (name, "dls"))
    assert held[0] <= 2  # by the tolerance of DAQP
    assert episode.position_error.max() > 1e-3
    margin = np.minimum(episode.q - scenario.arm.lower, scenario.arm.upper - episode.q)
    assert 0.0 <= margin.min() < 5e-3
    assert unaware[0] > 10


@pytest.mark.parametrize("name", ["pink", "roboplan"])
def test_the_acceleration_limit_is_kept(name):
    scenario = circle(speed=1.0, acceleration_limit=np.full(7, 0.4))
    (episode, held), (_, unaware) = (played(scenario, one) for one in (name, "mink"))
    assert held[2] == 0
    qddot = np.diff(episode.qdot, axis=0, prepend=0.0) / scenario.dt
    assert abs(qddot).max() == pytest.approx(0.4, rel=1e-3)
    assert unaware[2] > 10


def test_without_a_solution_the_arm_is_stopped_and_that_is_said():
    """Too fast towards a stop: no acceleration that is allowed leaves it in time."""
    scenario = circle(acceleration_limit=np.full(7, 0.1))
    policy = made("pink", scenario)
    seen = observation(scenario, policy, np.array(scenario.arm.upper) - 1e-4)
    action, state = policy.predict({**seen, "qdot": np.array(scenario.arm.velocity_limit)})
    assert not action.any()
    assert policy.report(state).status[0] == Status.DIVERGED


def test_a_missing_package_is_one_clear_error(monkeypatch):
    name, imports = "pink", importlib.import_module

    def missing(module, *arguments):
        if module == name:
            raise ModuleNotFoundError(f"No module named {module!r}")
        return imports(module, *arguments)

    monkeypatch.setattr(importlib, "import_module", missing)
    wanted = r"The policy 'pink' needs pin-pink: pip install \"ikgym\[rivals\]\""
    with pytest.raises(MissingDependencyError, match=wanted):
        baselines.make(name, circle())
    # One of all is no reason to leave the others out.
    rows = evaluate(circle().replace(steps=3), ["dls", name])
    assert [row.policy for row in rows] == ["dls"]
    assert [one.policy for one in rows.skipped] == [name]
    assert "ikgym[rivals]" in rows.skipped[0].reason
    with pytest.raises(InvalidInputError, match=wanted):
        evaluate(circle(), name)


def test_two_threads_do_not_share_objects(monkeypatch):
    """Of the packages: what they hold changes at each call."""
    scenario = circle()
    policy = made("pink", scenario)
    number, make_step = [], type(policy).make_step
    monkeypatch.setattr(type(policy), "make_step", lambda self: number.append(self) or make_step(self))
    seen = observation(scenario, policy)
    for _ in range(2):
        policy.predict(seen)
    assert len(number) == 1
    other = threading.Thread(target=policy.predict, args=(seen,))
    other.start()
    other.join()
    assert len(number) == 2


def test_turned_by_the_shortest_way():
    rotation = rodrigues(np.array([0.6, 0.0, 0.8]), 1.0)
    for angle in (0.0, 1e-8, 0.3, 2.0):
        axis = rodrigues(rotation[:, 0].copy(), angle) @ rotation[:, 2]
        found = turn(rotation[:, 2], axis) @ rotation
        np.testing.assert_allclose(found[:, 2], axis, atol=1e-14)
        np.testing.assert_allclose(found @ found.T, np.eye(3), atol=1e-14)
        assert np.trace(found @ rotation.T) == pytest.approx(1.0 + 2.0 * np.cos(angle), abs=1e-14)
