"""Receding horizon, minimised to its optimum by Newton's method.

Initial guesses and restart candidates are worth their time: without candidates (``restart_steps=0``) `rhc_foresight`
costs 1.10 (1.03 to 1.20) times as much on 53 validation episodes of `varga7-pose-random` and 2.7 (1.7 to 4.8) times on
58 of `varga7-random`, with one guess (``starts=1``) 1.03 (1.01 to 1.05) and 1.10 (1.03 to 1.21) times. All guesses in
the first call (``start_steps=0``) cost as much as guesses spread over calls, but that call takes 22 ms of CPU time
instead of 0.8. With ``recovery_steps`` 48 of 48 episodes that start 0.5 rad off in all joints are back on the
trajectory within 500 steps, without 36.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Sequence
from typing import Annotated, ClassVar

import numpy as np
import numpy.typing as npt

from baselines.policy import Memory
from baselines.policy.compiled import CompiledPolicy, derived
from baselines.policy.problem import sweep_bodies
from baselines.solvers.receding_horizon.newton.grid import offsets
from baselines.solvers.receding_horizon.newton.receding import HorizonMemory, plan_step, plan_step_among
from baselines.solvers.receding_horizon.newton.settings import PlanSettings, plain_settings
from baselines.solvers.resolved_rate.base import relative_weights
from ikgym.exceptions import InvalidInputError
from ikgym.scenarios.preview import FARTHEST
from ikgym.validation import Bounds, Flag, FloatArray, IntArray, read_only

# Range of the kernel's counters and random numbers.
MOST = 2**31 - 1


@dataclasses.dataclass(frozen=True, eq=False)
class RecedingHorizon(CompiledPolicy):
    """Minimises the cost of Varga 2021 over a horizon of any length; the first joint velocity is applied.

    A :class:`ikgym.ProximityCost` is not minimised.

    The unknowns are the joint coordinates at the knots of the horizon. In them the Hessian is block-tridiagonal, so
    that a damped Newton step costs time linear in the number of knots. The kinks of the cost, on which minima often
    lie, and the limits are held by multipliers, see :mod:`newton.terms`. The plan of one period, shifted
    by one step, is the warm start of the next.

    To convergence (``iterations=None``) the plan is a local minimum of the horizon's cost, found with the exact Hessian
    where that is positive definite; with a number of iterations it is that many Gauss–Newton steps away from the
    previous plan, which at 1 kHz is close (the real-time iteration). A long horizon has many local minima, some of them
    very costly: several ``starts`` and restart candidates are for that.

    The limits of the arm and the velocity limit of the scenario are constraints of the plan. Between blocks of a and b
    steps the velocity changes by at most q̈_max Δt (a + b) / 2, and from the last command by q̈_max Δt. Under limits the
    plan before is moved by what the drives missed of that command, else the arm could not continue along it. Where
    the horizon ends before the episode does, the last knot leaves the way that a stop takes, so that no plan runs into
    a joint limit that it does not see yet; with ``stop_at_end`` nothing comes behind the episode's end. Arms with
    limits of acceleration are planned for by an interior point method, see :mod:`newton.interior_point`: to
    convergence to the optimum, with a number of iterations with a barrier parameter that stays, and without limits
    nothing changes.

    Where bodies may not touch, the clearance of each near pair at each knot is a limit like the others, see
    :mod:`newton.clearance`. Obstacles that move are held still over the horizon, where they will be after the coming
    step. The first step of a plan is checked between its ends, too: one in which something would touch is slowed down.

    Args:
        problem: The scenario as the policy knows it.
        horizon: HL, the number of grid points with the present one. At least 2; HL - 1 steps must be shown ahead.
        iterations: Newton steps in one control period, at least 30 in the first; None for as many as the optimum takes.
        move_blocks: Knots of the horizon (move blocking); None for one at each of its HL - 1 steps. Fewer are spaced
            out: two blocks of one step, then lengths that grow geometrically. Within a block the joint velocity is
            constant, and its tracking cost follows the trapezoidal rule.
        terminal_weight: Factor of the tracking cost at the last grid point, unless the episode ends before it; 1 is the
            paper's cost.
        stop_at_end: Whether the horizon ends where the episode does, which ``remaining`` tells. Else it looks on, where
            costs count no more.
        starts: Initial guesses from which the first plan of an episode is chosen: damped least squares from knot to
            knot, and with more than one the others with a random drift in the null space and random damping.
        restart_steps: Newton steps of a restart candidate: a second plan, which branches off at a random knot into a
            random guess, has one Newton step a control period, and replaces the plan when it is cheaper after its last
            step. 0 for none.
        seed: Of the random guesses: all episodes have the same ones.
        start_steps: Newton steps of an initial guess in a period, where they are spread over the first periods: the
            first plan comes from the first guess, with its steps shared by the first two periods, and each of
            ``starts`` - 1 periods after them improves another guess, like a restart candidate, until it is
            cheaper than the plan or unpromising. A later candidate begins in a period without a Newton step of it, so
            that no period has both. 0 to try all guesses in the first period, which takes that much longer.
        recovery_steps: Newton steps in a period instead of ``iterations``, where the one before ended with joint
            velocities beyond their limits; there is no restart candidate then. 0 for no more than
            ``iterations``.
        rate_weight: Cost of changes of velocity in the plan, rate_weight · Σ (q̇_k - q̇_{k-1})² over joints and steps,
            in [cost] / [(rad/s)²] or [cost] / [(m/s)²]; the first change is that from the velocity last applied. The
            score has no such term: smooth velocities have their price. 0 for none.
        joint_weights: w, above 0: how costly the motion of a joint is, as a factor of its velocity cost; only ratios
            count, and the smallest one means the cost itself. One number, or one a joint. Equal by default, unlike
            those of `qp`: the plan is then the optimum of the cost that is scored. They act less than in `qp`: against
            a cost of the fourth power a velocity falls with the cube root of w.
        tolerance: Relative precision of the horizon's cost at which it counts as minimal.
        clearance: The distance in [m] that bodies keep at the knots of a plan, where they may not touch.

    Raises:
        InvalidInputError: A parameter is out of its range.
    """

    horizon: Annotated[int, Bounds(at_least=2, at_most=FARTHEST)] = 30
    iterations: Annotated[int, Bounds(at_least=1, at_most=MOST)] | None = None
    move_blocks: Annotated[int, Bounds(at_least=1)] | None = None
    terminal_weight: Annotated[float, Bounds(at_least=0.0)] = 1.0
    stop_at_end: Flag = False
    starts: Annotated[int, Bounds(at_least=1, at_most=MOST)] = 1
    restart_steps: Annotated[int, Bounds(at_least=0, at_most=MOST)] = 0
    seed: Annotated[int, Bounds(at_least=0, at_most=MOST)] = 0
    start_steps: Annotated[int, Bounds(at_least=0, at_most=MOST)] = 0
    recovery_steps: Annotated[int, Bounds(at_least=0, at_most=MOST)] = 0
    rate_weight: Annotated[float, Bounds(at_least=0.0)] = 0.0
    joint_weights: float | Sequence[float] = 1.0
    tolerance: Annotated[float, Bounds(above=0.0)] = 1e-7
    clearance: Annotated[float, Bounds(at_least=0.0)] = 1e-3

    name: ClassVar[str] = "rhc"
    step, step_among = plan_step, plan_step_among
    grain: ClassVar[int] = 1

    #: Steps from now to the knots. Shape (K,).
    offsets: npt.NDArray[np.int64] = dataclasses.field(init=False, repr=False)
    #: The settings in two blocks, see :func:`plain_settings`.
    reals: FloatArray = derived()
    integers: IntArray = derived()
    #: See :class:`newton.bodies.Clearance`; without bodies of no rows. Shape (k, n).
    sweep: FloatArray = derived()

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.move_blocks is not None and self.move_blocks >= self.horizon:
            raise InvalidInputError(
                f"move_blocks: expected at most horizon - 1 = {self.horizon - 1}, a knot at each step, got "
                f"{self.move_blocks}."
            )
        if self.start_steps and not self.restart_steps:
            raise InvalidInputError(f"start_steps: expected 0 where restart_steps is 0, got {self.start_steps}.")
        knots = self._knots()
        knots.flags.writeable = False
        problem, model = self.problem, self.problem.model
        change = problem.dt * model.acceleration_limit if self.interior_point else np.zeros(0)
        given = {name: getattr(self, name) for name in PlanSettings._fields if name in self.parameters}
        given |= {"at": knots, "change_limit": change, "iterations": -1 if self.iterations is None else self.iterations}
        given["joint_weights"] = relative_weights("joint_weights", self.joint_weights, model.joints)
        settings = PlanSettings(**given)
        reals, integers = plain_settings(settings)
        sweep = read_only(sweep_bodies(model) if self.among_bodies else np.empty((0, model.joints)))
        self._settle(offsets=knots, reals=reals, integers=integers, sweep=sweep)

    @property
    def interior_point(self) -> bool:
        """Whether plans are made by the interior point method: with limits of acceleration or among bodies."""
        return bool(np.isfinite(self.problem.model.acceleration_limit).any()) or self.among_bodies

    @functools.cached_property
    def remembers_command(self) -> bool:
        """See :attr:`SolverPolicy.remembers_command`; plans under any limits move along with the arm, too."""
        return self.interior_point or self.rate_weight > 0.0

    @property
    def preview(self) -> int:
        """Grid points 2 … HL lie ahead."""
        return self.horizon - 1

    def memory(self, rows: int) -> HorizonMemory:
        """An empty plan and restart candidate; see :class:`HorizonMemory`."""
        width = self.problem.task.error_size + 3 * self.problem.model.joints
        plans = np.zeros((rows, 2 if self.restart_steps else 1, len(self.offsets) * width))
        return HorizonMemory(plans, np.zeros((rows, 4), dtype=np.int64), np.zeros((rows, self.problem.model.joints)))

    def _knots(self) -> npt.NDArray[np.int64]:
        """Steps from now to the knots. Shape (K,)."""
        return offsets(self.horizon - 1, self.move_blocks)

    @classmethod
    def kernel_fields(cls) -> tuple[str, ...]:
        """See :meth:`CompiledPolicy.kernel_fields`; most are in blocks, which are read faster."""
        return "reals", "integers", "clearance", "sweep"

    def plan(self, state: Memory) -> FloatArray:
        """The plan behind a state that `predict` returned: joint coordinates at the knots :attr:`offsets` ahead.

        Where the horizon was cut at the episode's end the knots behind it are of no use.

        Returns:
            Joint coordinates in [rad] or [m]. Shape (B, K, n).
        """
        plans, n = HorizonMemory(*self.memory_of(state)).plans, self.problem.model.joints
        return plans[:, 0, : len(self.offsets) * n].reshape(len(plans), -1, n).copy()
