"""What observations have besides the usual keys: ages of measurements and past commands."""

import dataclasses
from typing import ClassVar

import numpy as np
import pytest

import baselines
import ikgym
from baselines.policy import Batch, Problem, Solution, SolverPolicy, statuses
from ikgym.exceptions import InvalidInputError
from tests.comparison import identical

SCENARIO = ikgym.scenarios.get("varga7-fast")
SEEN: list[Batch] = []


@dataclasses.dataclass(frozen=True, eq=False)
class Spy(SolverPolicy):
    """Keeps what it is shown."""

    name: ClassVar[str] = "spy"

    def solve(self, batch, memory):
        SEEN.append(batch)
        return Solution(np.zeros(batch.q.shape), memory, *([statuses(len(batch.q))] * 2))


def observed(rows=None, **extras):
    lead = () if rows is None else (rows,)
    shapes = {"q": (7,), "qdot": (7,), "pose": (6,), "nominal": (1, 6), "remaining": (1,)}
    return {key: np.zeros((*lead, *shape)) for key, shape in shapes.items()} | extras


def shown(observation):
    SEEN.clear()
    Spy(Problem.of(SCENARIO)).predict(observation)
    return SEEN[-1]


def test_a_policy_is_shown_ages_and_commands_where_there_are_any():
    assert shown(observed())[5:] == (None, None, None, None, None)
    single = shown(observed(pose_age=[3], commands=np.ones((2, 7))))
    assert single.q_age is None
    assert identical(single.pose_age, np.array([[3.0]]))
    assert single.commands.shape == (1, 2, 7)
    several = shown(observed(2, q_age=np.array([[1.0], [2.0]])))
    assert identical(several.q_age, np.array([[1.0], [2.0]]))


def test_compiled_solvers_take_no_notice_of_them():
    policy = baselines.make("dls", SCENARIO)
    seen = observed(3)
    action, _ = policy.predict(seen)
    assert identical(policy.predict(seen | {"pose_age": np.ones((3, 1))})[0], action)


@pytest.mark.parametrize(
    ("extras", "message"),
    [
        ({"q_age": [-1]}, r"observation\['q_age'\]: expected ages of at least 0 steps, got -1"),
        ({"pose_age": 1.0}, r"observation\['pose_age'\]: expected shape \(1,\), got \(\)"),
        ({"commands": np.ones((2, 6))}, r"observation\['commands'\]: expected shape \(h, 7\), got \(2, 6\)"),
        ({"pose_age": ["now"]}, r"observation\['pose_age'\]: expected an array of numbers"),
        ({"pose_age": [np.nan]}, "expected finite numbers"),
    ],
)
def test_what_is_wrong_with_them_is_said(extras, message):
    with pytest.raises(InvalidInputError, match=message):
        shown(observed(**extras))
