"""The base of policies around another one: what a wrapper of a few lines gets from it."""

import dataclasses
from typing import ClassVar, NamedTuple

import gymnasium as gym
import numpy as np
import pytest

import baselines
from baselines.policy import Problem
from baselines.wrapper import NamedWrapper
from ikgym import scenarios
from ikgym.exceptions import InvalidInputError
from tests.comparison import identical

PROBLEM = Problem.of(scenarios.get("varga7-fast"))


class Steps(NamedTuple):
    made: np.ndarray


@dataclasses.dataclass(frozen=True, eq=False)
class Halved(NamedWrapper):
    """Half the velocities of another policy; counts its steps."""

    name: ClassVar[str] = "halved"
    nests: ClassVar[bool] = False

    def own_memory(self, rows):
        return Steps(np.zeros(rows, dtype=np.int64))

    def solve(self, batch, memory):
        outer, inside = self.split(memory)
        step = self.ask(batch, inside)
        return self.solution(0.5 * step.qdot, Steps(outer.made + 1), step)


def observation(preview, rows=2):
    single, _ = gym.make("RedundantIK-v0", scenario="varga7-fast", preview=preview).reset(seed=0)
    return {name: np.stack([array] * rows) for name, array in single.items()}


@pytest.mark.parametrize("name", ["dls", "rhc_gradient"])
def test_a_wrapper_of_a_few_lines(name):
    alone, policy = baselines.make(name, "varga7-fast"), Halved(PROBLEM, policy=name)
    assert policy.preview == alone.preview
    shown, state, inner = observation(alone.preview), None, None
    for k in range(3):
        start = np.array([False, k == 2])
        action, state = policy.predict(shown, state, start)
        expected, inner = alone.predict(shown, inner, start)
        np.testing.assert_allclose(action, 0.5 * expected, rtol=1e-6)
        assert identical(policy.inner_state(state), inner)
        assert identical(policy.diagnostics(state), alone.diagnostics(inner))
        assert identical(policy.report(state), alone.report(inner))
    outer, _ = policy.split(policy.memory_of(state))
    assert outer.made.tolist() == [3, 1]


def test_what_cannot_be_inside():
    with pytest.raises(InvalidInputError, match="damping: expected"):
        Halved(PROBLEM, options={"damping": -1.0})
