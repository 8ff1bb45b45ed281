"""The parameters of a learning task."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Sequence
from typing import Annotated, Any

import numpy as np

from ikgym import scenarios
from ikgym.exceptions import InvalidInputError
from ikgym.frozen import Frozen
from ikgym.scenarios import Scenario
from ikgym.validation import LARGEST, Bounds, Flag, Positive, float_array, shorten


@dataclasses.dataclass(frozen=True)
class Task(Frozen):
    """A scenario as a learning task: its observation, action and reward.

    *Actions.* ±1 is a share of the largest joint velocities, those that arm and scenario allow.

    *Observations.* Numbers of size 1, at most 5, of shape (f,), float32, learned from without a model:

    | size | feature |
    |---|---|
    | n | joint coordinates from home in [rad], of prismatic joints in half of their ranges |
    | n | joint velocities last applied, as shares of the largest |
    | 2 w each | position and orientation error to the reference at each step ahead that is shown, in units of \
`coarse`, then the hyperbolic tangent of the same in units of `fine`; 1 rad counts as `radian` |
    | n each | with `inverse`, joint velocities that reach the reference at each step ahead in time, by damped least \
squares of the model, as shares of the largest |
    | 1 each | ages of `q` and `pose` in units of ten steps, where sensors are slow or late |
    | h n | the last h commands, as shares of the largest joint velocities |
    | c | the context of the episode, from -1 to 1, with `context` |

    Errors have w components, 3 for tasks of position alone, else 6. They are measured ones, seen from the frame of
    joint 1, so that a turn of joint 1 changes none of them; from the base frame where joint 1 is prismatic, and for
    skew coordinates, which are no vector. Without a home joints are seen from the middle of their range, or from 0;
    half of a range is 1 m where a prismatic joint has none. With a `history` the last observations are concatenated,
    newest first: where measurements are late or missing, earlier commands and measurements tell where the arm is now.
    An episode begins with its first observation repeated.

    *Rewards.* Of the stage cost c, which counts true errors, velocities and proximity, from 0 to 1:

        reward = 1 / (1 + (√c · 1 mm / h)^k)

    h is `half`, k `steepness`. With Δx = 1 mm and P_X = 2, √c · 1 mm is a distance where 1 rad counts as 1 m. Steps
    that are not `counted` have the reward 0. With `progress` K, each step is also rewarded by K times the change of
    the quotient in this step. Such a shaping by potentials (Ng, Harada and Russell 1999) is below 0 where an arm moves
    away, and adds up to the difference between the start, as the first observation shows it, and the end.

    Args:
        scenario: A scenario or its name, see `ikgym.scenarios.find`.
        ahead: Times ahead at which the reference is shown, in [s], rising; each is at least one step.
        lost_distance: Position error in [m] at which an episode ends; None for never.
        history: Number of observations shown side by side, from 1 to 1000.
        commands: h, the number of past commands shown.
        share: Share of the largest joint velocities that an action of 1 means, above 0.
        radian: Weight of 1 rad in [m], in the observation, above 0.
        half: Distance with the reward 1/2 in [m], above 0.
        steepness: k, from 0.1 to 2; rewards with a small one span more decades of distances.
        coarse: Unit of errors in the observation, in [m], above 0.
        fine: Unit of the hyperbolic tangent of the same, in [m], above 0.
        counted: Steps at the end of an episode that are rewarded and scored; None for all.
        progress: Factor of progress, from 0.
        inverse: Whether the observation has joint velocities of the model's damped inverse Jacobian.
        context: Whether the observation ends with the context of the episode, see :class:`ikgym.Plant`.

    Raises:
        InvalidInputError: A value is refused.
    """

    scenario: str | os.PathLike[str] | Scenario = "learning-track"
    ahead: tuple[float, ...] = (0.01, 0.05)
    lost_distance: float | None = 0.1
    history: Annotated[int, Bounds(at_least=1, at_most=1000)] = 1
    commands: int = 0
    share: Positive = 0.8
    radian: Positive = 1.0
    half: Positive = 0.025
    steepness: Annotated[float, Bounds(at_least=0.1, at_most=2.0)] = 2.0
    coarse: Positive = 0.03
    fine: Positive = 0.01
    counted: Annotated[int, Bounds(at_least=1)] | None = None
    progress: Annotated[float, Bounds(at_least=0.0, at_most=LARGEST)] = 0.0
    inverse: Flag = False
    context: Flag = False

    def arguments(self) -> dict[str, Any]:
        """Arguments of :class:`ikgym.RedundantIKEnv`, single or vector.

        Raises:
            UnknownNameError: There is no such scenario.
            InvalidInputError: The times ahead are none, or the plant has no context to show.
        """
        scenario = scenarios.find(self.scenario)
        if self.context and not scenario.plant.context:
            raise InvalidInputError(f"context: expected a plant with numbers drawn from ranges, got {scenario.plant}.")
        shown = {"preview": steps_ahead(self.ahead, scenario.dt), "commands": self.commands}
        return {"scenario": scenario, **shown, "lost_distance": self.lost_distance}


def steps_ahead(ahead: Sequence[float], dt: float) -> tuple[int, ...]:
    """Times ahead in [s] as steps, at least one each; times that fall on the same step are shown once."""
    times = float_array("ahead", ahead)
    if times.ndim != 1 or not times.size or (np.diff(times, prepend=0.0) <= 0.0).any():
        raise InvalidInputError(f"ahead: expected rising times above 0 in [s], got {shorten(ahead)}.")
    return tuple(dict.fromkeys(max(1, round(time / dt)) for time in times.tolist()))
