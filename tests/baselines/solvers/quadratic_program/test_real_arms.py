"""`qp` on the scenarios of real arms: on feasible paths by micrometres, elsewhere no worse than another project."""

import numpy as np
import pytest

import ikgym
from baselines.status import Status
from tests.baselines.solvers.quadratic_program.paths import played

FEASIBLE = {"panda-lemniscate": 1e-5, "panda-glue": 1e-5, "panda-line": 1e-5, "iiwa14-square": 1e-5}
FEASIBLE |= {"iiwa14-circle": 1e-5, "iiwa14-glue": 1e-5, "tiago-raster": 5e-5, "tiago-glue": 5e-5}


@pytest.mark.parametrize(("name", "bar"), FEASIBLE.items())
def test_feasible_paths_are_met(name, bar):
    episode = played(ikgym.scenarios.get(name))
    assert episode.position_error.max() < bar
    assert episode.orientation_error.max() < 1e-4
    assert not episode.at_limit.any()
    assert (episode.status == Status.APPLIED).all()


#: Largest errors in [m] of Pink (pin-pink 4.4.0, solver daqp, its limits of position, velocity and acceleration, frame
#: costs 1, posture cost 0.001 to home in 1 s, the better of lm_damping 0 and 1), by a separate program.
PINK = {"panda-turn": 0.12496, "panda-edge": 0.03438, "panda-fast": 0.25735}
PINK |= {"iiwa14-turn": 0.01217, "iiwa14-edge": 0.05098, "iiwa14-fast": 0.15736}
PINK |= {"tiago-turn": 0.01469, "tiago-edge": 0.03874, "tiago-fast": 0.11897}


@pytest.mark.parametrize("name", PINK)
def test_paths_that_no_arm_can_follow(name):
    episode = played(ikgym.scenarios.get(name))
    assert episode.position_error.max() < 1.05 * PINK[name]
    assert not episode.at_limit.any()


def test_out_of_reach_and_back_with_the_same_elbow():
    """From another start, too; without the damping that grows with the error the elbow ends at its stop."""
    scenario = ikgym.scenarios.get("panda-edge")
    scenario = scenario.replace(start=scenario.start_of(0) + 0.05 * np.random.default_rng(0).uniform(-1, 1, 7))
    assert played(scenario).position_error[-1] < 1e-5
    assert played(scenario, lm_damping=0.0).position_error[-1] > 0.1


def test_what_the_defaults_of_other_solvers_are_chosen_for():
    """The figures of docs/policies.md: TIAGo's torso is too slow for its share of a circle."""

    def error(name, **parameters):
        return played(ikgym.scenarios.get("tiago-circle"), name, **parameters).position_error.max()

    assert error("dls") == pytest.approx(8.7e-3, rel=0.05)
    assert error("weighted_pseudoinverse") < 1e-6
    assert error("weighted_pseudoinverse", weights=1.0) == pytest.approx(8.7e-3, rel=0.05)
    assert error("null_space") == pytest.approx(9.5e-3, rel=0.05)
    assert error("null_space", objective="posture") == pytest.approx(0.09, rel=0.05)
