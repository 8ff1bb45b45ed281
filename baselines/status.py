"""Status of a solve. A failed solve is data, not an exception."""

from __future__ import annotations

import enum

import numpy as np
import numpy.typing as npt


class Status(enum.IntEnum):
    """Status of a solver in one step, from good to bad.

    A row of results has the worst status of its episode.
    """

    #: Nothing is said: the policy is no solver of this package, such as a model of Stable-Baselines3.
    UNKNOWN = -1

    #: The solver's test was passed: its residual is within a tolerance.
    CONVERGED = 0
    #: A formula was applied, a network evaluated or a path played, in one pass: nothing is said about convergence.
    APPLIED = 1
    #: The test was not passed: the iterations ran out, or led no further; the last iterate was used.
    ITERATION_LIMIT = 2
    #: The Jacobian had lost rank, and the directions lost were left out.
    RANK_DEFICIENT = 3
    #: More was asked for than limits allow: joints were cut to theirs, or the task is not served as asked for.
    SATURATED = 4
    #: A vector was too long for the rotation that was to turn it; the arm was stopped for this step.
    NOT_A_ROTATION = 5
    #: The iterates blew up, or are no numbers; the arm was stopped for this step and the memory cleared.
    DIVERGED = 6

    @property
    def label(self) -> str:
        """The name in results, for example ``iteration_limit``."""
        return self.name.lower()


def statuses(rows: int, status: Status = Status.APPLIED) -> npt.NDArray[np.int64]:
    """The same status for all rows; that of a formula if left out. Shape (B,)."""
    return np.full(rows, int(status))
