"""The motion of `qp` to its posture: soft from rest to rest, and good for paths that are driven again and again."""

import numpy as np
import pytest

import ikgym
from tests.baselines.controller.circles import circle
from tests.baselines.solvers.quadratic_program.paths import played

PATHS = ("circle", "lemniscate", "square", "raster", "glue")
CATALOGUE = ("panda-circle", "panda-lemniscate", "iiwa14-circle", "iiwa14-lemniscate", "tiago-circle")


def scenario_of(name):
    """A scenario of the catalogue, or a circle of an arm that is not in it."""
    return circle(name, seconds=4.0) if name in ("baxter", "pr2") else ikgym.scenarios.get(name)


def accelerations(scenario, **parameters):
    """The largest one in the first 0.2 s, and in all of the path, in [rad/s²] or [m/s²]."""
    qdot = played(scenario, **parameters).qdot
    changes = np.abs(np.diff(qdot, axis=0, prepend=0.0)) / scenario.dt
    return np.array([changes[: round(0.2 / scenario.dt)].max(), changes.max()])


def marked(name):
    return name if name == "panda-circle" else pytest.param(name, marks=pytest.mark.slow)


@pytest.mark.parametrize("name", [marked(name) for name in (*CATALOGUE, "baxter", "pr2")])
def test_it_begins_softly(name):
    scenario = scenario_of(name)
    assert (accelerations(scenario) <= 1.3 * accelerations(scenario, secondary_gain=0.0)).all()


def lap(scenario, start):
    """The posture after a circle from a start in [rad] or [m], and the largest error in [m]."""
    episode = played(scenario.replace(start=start))
    return episode.q[-1], episode.position_error.max()


@pytest.mark.parametrize("name", [marked(name) for name in ("panda-circle", "iiwa14-circle", "tiago-circle")])
def test_circles_in_a_row_end_where_they_begin(name):
    scenario = scenario_of(name)
    q, _ = lap(scenario, scenario.start_of(0))
    for _ in range(4):
        before = q
        q, error = lap(scenario, before)
        assert np.abs(q - before).max() < 2e-3
        assert error < 2e-6


@pytest.mark.parametrize(
    "name", ["tiago-line", *(pytest.param(f"tiago-{name}", marks=pytest.mark.slow) for name in PATHS)]
)
def test_a_slow_torso_is_spared(name):
    """With equal weights it comes near to its limit or to it on these paths."""
    scenario = scenario_of(name)
    episode = played(scenario)
    torso = np.abs(episode.qdot[:, 0]).max() / scenario.velocity_limit[0]
    assert torso < 0.7
    assert episode.position_error.max() < 2e-6
    assert np.abs(played(scenario, joint_weights=1.0).qdot[:, 0]).max() / scenario.velocity_limit[0] > torso


def test_weights_are_the_users_to_choose():
    scenario = ikgym.scenarios.get("panda-circle")
    held = played(scenario, joint_weights=(1e6, *[1.0] * 6)).q[:, 0]
    assert np.ptp(held) < 0.01 < np.ptp(played(scenario).q[:, 0])
