"""The rule that recommends a solver, on made-up rows."""

import dataclasses

import pytest

from baselines.evaluation.compare.rule import recommend
from tests.baselines.evaluation.test_report import BASE

DT = 0.004
GOOD = dataclasses.replace(
    BASE, followed=True, position_error_max=1e-6, orientation_error_max=1e-6, qddot_peak=1.0, time_p50_us=20.0
)
MISSES = {"followed": False, "position_error_max": 0.0123, "orientation_error_max": None}
STOPPED, SLOW, HARSH = {"steps_at_joint_limit": 1}, {"time_p50_us": 2001.0}, {"qddot_peak": 3.1}


def rows(**changes):
    """Rows of three solvers, good ones except for the changes."""
    return {name: dataclasses.replace(GOOD, **changes.get(name, {})) for name in ("sns", "dls", "qp")}


ALL_MISS = rows(qp=MISSES, sns=MISSES, dls=MISSES)


def test_qp_is_taken_where_nothing_stands_in_the_way():
    chosen = recommend(rows(), rows(), rows(), DT)
    assert (chosen.solver, chosen.retimed, chosen.late) == ("qp", False, True)
    assert str(chosen) == "Recommended: qp. qp follows the path, with late drives too."
    edge = {"qddot_peak": 2.0, "time_p50_us": 2000.0}  # of what is allowed
    assert recommend(rows(qp=edge), {}, rows(), DT).solver == "qp"
    # The calmest is one of those that follow.
    assert recommend(rows(sns={**STOPPED, "qddot_peak": 0.1}), {}, rows(), DT).solver == "qp"


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (MISSES, "qp errs by 12.3 mm."),
        (STOPPED, "qp has a joint at a stop."),
        (MISSES | {"orientation_error_max": 2e-3}, "qp errs by 12.3 mm, 2 mrad."),
        (SLOW, "qp takes 2001 µs a call of a period of 4000 µs."),
        (HARSH, "qp needs 3.100 times the acceleration of the calmest."),
    ],
)
def test_the_next_one_is_taken_where_qp_has_a_fault(change, reason):
    chosen = recommend(rows(qp=change), {}, rows(), DT)
    assert chosen.solver == "sns"
    assert reason in chosen.reason


def test_who_follows_with_late_drives_takes_precedence():
    chosen = recommend(rows(), {}, rows(qp=MISSES), DT)
    assert (chosen.solver, chosen.late) == ("sns", True)
    assert "qp errs by 12.3 mm with late drives." in chosen.reason
    chosen = recommend(rows(), {}, ALL_MISS, DT)
    assert (chosen.solver, chosen.late) == ("qp", False)
    assert chosen.reason == "qp follows the path, but not with late drives."
    chosen = recommend(rows(qp=HARSH), {}, ALL_MISS, DT)
    assert chosen.reason.startswith(
        "qp needs 3.100 times the acceleration of the calmest. sns follows the path, but not"
    )


def test_a_path_is_retimed_only_where_no_solver_follows_it():
    chosen = recommend(rows(qp=MISSES, sns=MISSES), rows(), rows(), DT)
    assert (chosen.solver, chosen.retimed) == ("dls", False)
    chosen = recommend(ALL_MISS, rows(sns=MISSES), rows(), DT)
    assert (chosen.solver, chosen.retimed) == ("qp", True)
    assert str(chosen).startswith("Recommended: qp on the retimed path, which ikgym path --retime writes. No solver")
    assert "No solver follows the path as it is: qp errs by 12.3 mm. qp follows" in chosen.reason
    chosen = recommend(ALL_MISS, rows(qp=STOPPED, sns=MISSES, dls=SLOW), rows(), DT)
    assert (chosen.solver, chosen.retimed) == (None, False)
    assert str(chosen) == "Recommended: none of these solvers. No solver follows the path: qp errs by 12.3 mm."


def test_error_and_acceleration_decide_between_solvers_that_follow():
    """Errors of 1/100 with half of the acceleration in the same time; and a small error is not worth every jerk."""
    better = {"position_error_max": 1e-8, "orientation_error_max": 1e-8, "qddot_peak": 0.5}
    chosen = recommend(rows(sns=better), {}, rows(), DT)
    assert chosen.solver == "sns"
    assert chosen.reason.startswith("qp has 200.0 times the product of error and acceleration. sns follows")
    assert recommend(rows(sns=better | {"qddot_peak": 3.1}), {}, rows(), DT).solver == "qp"
    # The larger one of both errors counts, and twice the product is alike.
    assert recommend(rows(sns={"position_error_max": 1e-8}), {}, rows(), DT).solver == "qp"
    assert recommend(rows(qp={"qddot_peak": 1.9}), {}, rows(), DT).solver == "qp"
    assert (
        recommend(rows(dls={"position_error_max": 0.0, "orientation_error_max": None}), {}, rows(), DT).solver == "dls"
    )
