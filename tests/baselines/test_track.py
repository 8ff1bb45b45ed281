"""One episode as a trajectory: `baselines.track`."""

import csv
import io

import gymnasium as gym
import numpy as np
import pytest

import baselines
import ikgym
from baselines.evaluate import evaluate
from baselines.evaluation.plots import style
from baselines.files import ResultsError
from baselines.status import Status
from ikgym.exceptions import InvalidInputError, UnknownNameError

STEPS = 30


def test_it_is_the_episode_of_the_evaluation_and_of_gymnasium():
    track = baselines.track("varga7-random", "rhc_gradient:horizon=3", seed=2_000_000, steps=STEPS)
    (row,) = evaluate("varga7-random", "rhc_gradient", steps=STEPS)
    assert (track.scenario.name, track.policy, track.seed) == ("varga7-random", "rhc_gradient", 2_000_000)
    assert track.parameters == row.parameters
    assert (track.total_cost, track.solver_status.label) == (row.total_cost, row.solver_status)
    assert track.position_error.max() == row.position_error_max

    scenario = ikgym.scenarios.get("varga7-random").replace(steps=STEPS)
    policy = baselines.make("rhc_gradient", scenario)
    env = gym.make("RedundantIK-v0", scenario=scenario, preview=policy.preview)
    seen, _ = env.reset(seed=2_000_000)
    state = None
    for k in range(STEPS):
        np.testing.assert_array_equal(track.nominal[k], seen["nominal"][0])
        action, state = policy.predict(seen, state)
        seen, _, _, _, info = env.step(action)
        for name in ("q", "qdot", "pose"):
            np.testing.assert_array_equal(getattr(track, name)[k], seen[name])
        for name in ("tracking_cost", "velocity_cost", "position_error", "orientation_error"):
            assert getattr(track, name)[k] == info[name]
        assert track.times[k] == pytest.approx(info["time"])


def test_shapes_and_arrays_that_stay_as_they_are():
    track = baselines.track("zhang3-helix", "dls", steps=STEPS)
    for name, columns in {"q": 3, "qdot": 3, "pose": 3, "nominal": 3}.items():
        assert getattr(track, name).shape == (STEPS, columns)
    for name in ("times", "position_error", "tracking_cost", "velocity_cost", "status"):
        assert getattr(track, name).shape == (STEPS,)
    assert np.isnan(track.orientation_error).all()
    assert track.solver_status is Status(track.status.max())
    with pytest.raises(ValueError, match="read-only"):
        track.q[0] = 1.0
    with pytest.raises(AttributeError):
        track.q = None


@pytest.mark.parametrize("scenario", ["varga7-fast", "zhang3-helix"])
def test_csv_has_units_and_every_digit(tmp_path, scenario):
    track = baselines.track(scenario, "dls", steps=STEPS)
    track.to_csv(tmp_path / "track.csv")
    rows = list(csv.DictReader(io.StringIO((tmp_path / "track.csv").read_text(encoding="utf-8"))))
    assert len(rows) == STEPS
    names = list(rows[0])
    arm = ikgym.scenarios.get(scenario).arm
    joints = [
        (name, "m" if prismatic else "rad") for name, prismatic in zip(arm.joint_names, arm.prismatic, strict=True)
    ]
    assert names[: 1 + 2 * arm.joints] == [
        "time [s]", *(f"{name} [{unit}]" for name, unit in joints), *(f"{name} [{unit}/s]" for name, unit in joints),
    ]  # fmt: skip
    assert names[-5:] == [
        "position_error [m]", "orientation_error [rad]", "tracking_cost [1]", "velocity_cost [1]", "solver_status",
    ]  # fmt: skip
    size = track.pose.shape[1]
    assert [name for name in names if name.startswith("pose")] == [
        f"pose{i} [{'m' if i > size - 3 else '1'}]" for i in range(1, size + 1)
    ]
    np.testing.assert_array_equal([float(row["joint_1 [rad]"]) for row in rows], track.q[:, 0])
    np.testing.assert_array_equal([float(row[f"nominal{size} [m]"]) for row in rows], track.nominal[:, -1])
    assert rows[0]["solver_status"] == Status(int(track.status[0])).label
    empty = {row["orientation_error [rad]"] == "" for row in rows}
    assert empty == {not ikgym.scenarios.get(scenario).task.has_orientation}
    with pytest.raises(ResultsError, match="Cannot write"):
        track.to_csv(tmp_path / "track.csv" / "below")


def test_plot_is_a_figure():
    figure = baselines.track("varga7-fast", "dls", steps=STEPS).plot()
    drawn = [line for axes in figure.axes for line in axes.lines]
    assert len(drawn) == 2 + 3 * 2  # errors, and nominal and actual position
    assert len(style.png(figure)) > 1000


def test_whatever_can_be_evaluated_can_be_tracked():
    class Still:
        preview = 1

        def predict(self, observation, state=None, episode_start=None, deterministic=False):
            return np.zeros(3, dtype=np.float32), None

    track = baselines.track("zhang3-helix", Still(), steps=STEPS)
    assert (track.policy, track.parameters, track.solver_status) == ("Still", {}, Status.UNKNOWN)
    assert not track.qdot.any()
    scenario = ikgym.scenarios.get("zhang3-helix")
    assert baselines.track(scenario, baselines.make("dls", scenario), steps=3).policy == "dls"
    wrapped = baselines.track("zhang3-helix", Still(), steps=3, wrap=gym.wrappers.FlattenObservation)
    np.testing.assert_array_equal(wrapped.q, track.q[:3])


@pytest.mark.parametrize(
    ("arguments", "options", "error", "message"),
    [
        (("varga7-fest", "dls"), {}, UnknownNameError, "Did you mean 'varga7-fast'"),
        (("varga7-fast", "dsl"), {}, UnknownNameError, "Did you mean 'dls'"),
        (("varga7-fast", "dls"), {"steps": 0}, InvalidInputError, "steps: expected a whole number of at least 1"),
        (("varga7-fast", "dls"), {"seed": -1}, InvalidInputError, "seed: expected a whole number of at least 0"),
        (("varga7-fast", "rhc_gradient"), {"preview": 1, "steps": 3}, InvalidInputError, "2 steps ahead"),
        (("zhang3-helix", "follow_nominal"), {}, InvalidInputError, "follow_nominal does not suit zhang3-helix"),
        (("varga7-fast", ["dls"]), {}, InvalidInputError, "policy: expected a name"),
    ],
)
def test_bad_input_is_refused(arguments, options, error, message):
    with pytest.raises(error, match=message):
        baselines.track(*arguments, **options)
