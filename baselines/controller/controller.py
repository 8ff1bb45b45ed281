"""The control loop: a policy that is called once in each control period, behind guards."""

from __future__ import annotations

import logging
import math
import os
import time
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from baselines.controller import kernels
from baselines.controller.drives import IDENTIFY, LONGEST, Drives, drives_of, identified_drives, policy_for
from baselines.controller.guards import Guards, StopReason
from baselines.controller.reference import Pose, coordinates, coordinates_ahead, numbers, obstacle_rows
from baselines.controller.timing import Timing, timing_of
from baselines.policy import Batch, Memory, Report, SolverPolicy
from baselines.policy.arguments import read_memory
from baselines.policy_kernels import JERK
from baselines.registry import PolicySpec
from baselines.status import Status
from ikgym import scenarios
from ikgym.exceptions import InvalidInputError
from ikgym.kernels.limits import CHANGE, FASTEST
from ikgym.kernels.tasks import pose_rows
from ikgym.obstacles import Obstacle
from ikgym.scenarios import Scenario
from ikgym.scenarios.preview import furthest, offsets
from ikgym.validation import FloatArray, shorten, whole_number

logger = logging.getLogger("ikgym")

#: Steps left where no end of the episode is given.
ENDLESS = 1_000_000
_NONE: FloatArray = np.empty(0)
_DIVERGED = int(Status.DIVERGED)
#: Calls that :meth:`Controller.warm_up` times, and the largest number of them.
WARM_UP, MOST_CALLS = 500, 10_000_000


class Controller:
    """Calls a policy once in each control period: measurements go in, joint velocities come out.

    >>> controller = baselines.Controller(scenario)
    >>> controller.warm_up()
    >>> while running and controller.stopped is None:
    ...     qdot = controller.step(q, pose, reference)

    *Drives.* The policy moves a model without delay and lag, and the arm is made to follow it, see ``predicted``.
    Delay and lag of each joint are given, or identified while the arm moves. Until then 6 % of an error is corrected in
    a period, which is stable up to 25 periods of delay; then up to 46 %, which is stable if a delay changes by two.
    With perfect drives, ``Drives()``, the policy acts on the measurements themselves.

    *Limits.* Commands stay within the velocities and accelerations of the model. A joint brakes ahead of its stop, and
    one beyond its stop is led back; the acceleration limit takes precedence over the stop, see
    :func:`baselines.solvers.quadratic_program.velocity_box.velocity_box`. With imperfect drives commands are at most
    1.25 times as fast as the policy wanted to be within the last second, and joints without a limit of acceleration
    have that of :attr:`Guards.stopping_time`.

    *Guards.* Implausible measurements end in a controlled stop, which lasts until :meth:`reset`, see :class:`Guards`
    and :attr:`stopped`. Joint coordinates must not jump by 2π: unwrap them. Only arrays of a wrong shape raise an
    error.

    Args:
        scenario: Model, task, Δt and velocity limit, as :func:`ikgym.scenarios.find` takes it.
        policy: The policy, as text such as ``"qp:damping=1e-4"``, as a pair of name and parameters, or made for the
            scenario.
        drives: The drives, ``"identify"``, or a file ending in .toml that ``ikgym identify`` wrote.
        guards: The guards.
        steps: Control periods until the end of the task, for policies that look at it; no end in sight if left out.

    Raises:
        InvalidInputError: The policy is none, does not suit the scenario, or has privileged information on an episode
            that is not said to end; or the drives or the guards are none.
        UnknownNameError: There is no such scenario or policy, or parameter of it.
    """

    def __init__(
        self,
        scenario: str | Scenario,
        policy: PolicySpec | SolverPolicy = "qp",
        drives: Drives | str | os.PathLike[str] = IDENTIFY,
        *,
        guards: Guards | None = None,
        steps: int | None = None,
    ) -> None:
        if guards is not None and not isinstance(guards, Guards):
            raise InvalidInputError(f"guards: expected Guards(…) or None, got {shorten(guards)}.")
        self._scenario, self._guards = scenarios.find(scenario), Guards() if guards is None else guards
        drives = drives_of(drives, self._scenario)
        self.policy = policy_for(self._scenario, policy, drives, self._guards)
        if self.policy.reference and steps is None:
            raise InvalidInputError(f"{self.policy.name} has privileged information on one episode: give its steps.")
        self._steps = None if steps is None else whole_number("steps", steps, at_least=1)
        self._given = drives if isinstance(drives, Drives) else None
        problem = self._problem = self.policy.problem
        self._limits = problem.limits
        # The largest changes of a command that limits allow: larger ones are those of an arm that has stopped itself.
        steps = problem.limits[JERK]
        quickest = np.minimum(problem.limits[CHANGE], steps + np.sqrt(2.0 * problem.limits[FASTEST] * steps))
        self._takes = problem.dt, problem.largest_qdot, quickest
        self._unit, self._change = np.array(problem.velocity_limit), self._guards.deceleration(problem)
        delay = LONGEST if self._given is None else math.ceil(np.max(self._given.delay))
        self._bounds, self._numbers = self._guards.bounds(problem), self._guards.numbers(delay)
        self._shown, self._ahead = len(offsets(self.policy.preview)), furthest(self.policy.preview)
        self._joints, self._kind = problem.model.joints, problem.task.kind
        self.reset()

    def reset(self) -> None:
        """Begins anew: the memory is cleared, the arm is at rest, and no guard has stopped it."""
        n = self._joints
        self._state: Memory | None = None
        self._stopped: StopReason | None = None
        self._last, self._moved = np.zeros(n), np.zeros(n)
        self._kept, self._counters = np.zeros((2, n)), np.zeros(3)
        self._made = 0

    def step(
        self,
        q: npt.ArrayLike,
        pose: Pose | None,
        reference: Pose,
        *,
        qdot: npt.ArrayLike | None = None,
        q_age: float = 0.0,
        pose_age: float = 0.0,
        obstacles: npt.ArrayLike | Sequence[Obstacle] | None = None,
        commanded: npt.ArrayLike | None = None,
        commanded_acceleration: npt.ArrayLike | None = None,
    ) -> FloatArray:
        """The joint velocities for the next control period.

        Args:
            q: Measured joint coordinates in [rad] or [m]. Shape (n,).
            pose: Measured pose of the tool: task coordinates of shape (m,), or rotation (3, 3) and position (3,) in
                [m]. None where it is not measured: then it is the model's at q.
            reference: The pose wanted at the end of this period, and then as many as the policy looks ahead, see
                :attr:`ahead`: task coordinates (p, m), or rotations (p, 3, 3) and positions (p, 3) in [m].
            qdot: Measured joint velocities in [rad/s] or [m/s]; the last command if left out. The acceleration limits
                of the first command start from them, those of later ones from the command before, in the policy as
                well. Policies without acceleration limits are shown them in each period. Shape (n,).
            q_age: Control periods since q was measured.
            pose_age: Age of the pose, in periods.
            obstacles: The obstacles as they will be at the end of this period, in the order of the scenario's, where
                those move or are drawn: :mod:`ikgym.obstacles`, or rows as in the observation of the environment, of
                shape (o, 16).
            commanded: The joint velocities in [rad/s] or [m/s] that the arm has taken for the last command, where its
                interface reports them (libfranka: ``dq_d``): others than were sent where a message was lost. The limits
                of acceleration and jerk start from them, those of the first command as well. Cut to the largest
                velocities. The last command if left out. Shape (n,).
            commanded_acceleration: By how much these differ from those of the period before, divided by Δt, in [rad/s²]
                or [m/s²], where the interface reports it as well (libfranka: ``ddq_d``): the limits of jerk start from
                it, also where calls were missed for some periods. Only with ``commanded``; if left out, the difference
                to the command before. Shape (n,).

        Returns:
            Joint velocities in [rad/s] or [m/s], within the limits. Shape (n,).

        Raises:
            InvalidInputError: Something has a wrong shape, the reference is too short, or obstacles or commanded
                velocities are missing.
        """
        measured = numbers("q", q, (self._joints,))
        report = self._report(commanded, commanded_acceleration)
        speed = None if qdot is None else self._speed(qdot)
        seen, ahead = self._observe_pose(pose, measured), coordinates_ahead(self._problem.task, reference)
        nominal = ahead if len(ahead) == self._shown else self._select_poses(ahead)
        ages, solids = (_age("q_age", q_age), _age("pose_age", pose_age)), self._obstacles(obstacles)
        taken = report is None or kernels.take_report(*report, *self._takes, self._last, self._moved)
        if not taken:
            speed = np.full(self._joints, np.nan)  # which the guards refuse
        elif speed is None:
            speed = self._last.copy()
        if self._stopped is None:
            reason = kernels.watch(
                *(measured, speed, seen, ahead, *ages),
                *(self._kind, self._bounds, self._numbers, self._kept, self._counters),
            )
            if solids is not None and not np.isfinite(solids).all():
                reason = kernels.NOT_FINITE
            if self._made == 0 and reason != kernels.NOT_FINITE:
                if report is None:
                    self._last[:] = speed  # an arm in motion is taken over
                if commanded_acceleration is None:
                    self._moved[:] = 0.0
            if reason == 0:
                return self._compute_command(measured, speed, seen, nominal, ages, solids)
            self._stopped = StopReason(reason)
        return self._brake()

    def warm_up(self, calls: int = WARM_UP) -> Timing:
        """Compiles, and plays the scenario's reference on a perfect arm; then begins anew.

        Warns where the policy does not keep the control period.

        Args:
            calls: How many calls are timed.

        Raises:
            InvalidInputError: The policy fails, or a guard stops the arm at the start of the reference.
        """
        calls = whole_number("calls", calls, at_least=1, at_most=MOST_CALLS)
        self.reset()
        spent = self._play(calls)
        self.reset()
        return timing_of(self.policy.name, spent, self._problem.dt)

    @property
    def stopped(self) -> StopReason | None:
        """Why the arm was stopped; None if it was not."""
        return self._stopped

    @property
    def drives(self) -> Drives | None:
        """The drives as given, or as identified; None while there is no evidence of them."""
        if self._given is not None or self._state is None:
            return self._given
        return identified_drives(self.policy.diagnostics(self._state), self._problem.dt)

    @property
    def ahead(self) -> int:
        """Number of reference poses that the policy looks ahead."""
        return self._ahead

    @property
    def report(self) -> Report:
        """Status and iterations of the last step.

        Raises:
            InvalidInputError: There was no step yet.
        """
        if self._state is None:
            raise InvalidInputError("report: expected a step to be made first.")
        return self.policy.report(self._state)

    def _speed(self, qdot: npt.ArrayLike) -> FloatArray:
        """Measured joint velocities, cut to the largest ones. Shape (n,)."""
        fastest = self._takes[1]
        speed: FloatArray = np.clip(numbers("qdot", qdot, (self._joints,)), -fastest, fastest)
        return speed

    def _report(
        self, velocity: npt.ArrayLike | None, acceleration: npt.ArrayLike | None
    ) -> tuple[FloatArray, FloatArray] | None:
        """The command that the arm reports; its acceleration is empty where that is not reported. Shapes (n,)."""
        if velocity is None:
            if acceleration is not None:
                raise InvalidInputError("commanded_acceleration: expected commanded velocities as well, got none.")
            return None
        shape = (self._joints,)
        reported = _NONE if acceleration is None else numbers("commanded_acceleration", acceleration, shape)
        return numbers("commanded", velocity, shape), reported

    def _obstacles(self, obstacles: npt.ArrayLike | Sequence[Obstacle] | None) -> FloatArray | None:
        """Rows of the obstacles, where the policy is shown any. Shape (o, 16)."""
        problem = self._problem
        count = len(problem.surroundings.boxes) if problem.surroundings and problem.obstacles_shown else 0
        if count:
            return obstacle_rows(obstacles, count)
        if obstacles is not None:
            raise InvalidInputError("obstacles: expected none, since no obstacle of the scenario moves or is drawn.")
        return None

    def _observe_pose(self, pose: Pose | None, q: FloatArray) -> FloatArray:
        """Task coordinates of the measured pose, or of the model's at q. Shape (m,)."""
        if pose is not None:
            return coordinates("pose", self._problem.task, pose)
        out: FloatArray = np.empty((1, self._problem.task.size))
        pose_rows(self._problem.model.chain, self._kind, q[None], out)
        return out.ravel()

    def _select_poses(self, nominal: FloatArray) -> FloatArray:
        """The poses that the policy looks at, of those ahead. Shapes (p, m)."""
        if len(nominal) < self.ahead:
            raise InvalidInputError(
                f"reference: expected {self.ahead} poses, so far {self.policy.name} looks ahead, got {len(nominal)}."
            )
        preview = self.policy.preview
        return nominal[:preview] if isinstance(preview, int) else nominal[np.array(preview) - 1]

    def _compute_command(
        self,
        q: FloatArray,
        qdot: FloatArray,
        pose: FloatArray,
        nominal: FloatArray,
        ages: tuple[float, float],
        obstacles: FloatArray | None,
    ) -> FloatArray:
        """The policy's command within the limits, or that of a stop where it fails. Shape (n,)."""
        left = ENDLESS if self._steps is None else max(self._steps - self._made, 0)
        parts = q[None], qdot[None], pose[None], nominal[None], np.array([[float(left)]])
        batch = Batch(*parts, *np.array(ages).reshape(2, 1, 1)) if ages != (0.0, 0.0) else Batch(*parts)
        if obstacles is not None:
            batch = batch._replace(obstacles=obstacles[None])
        try:
            memory = self.policy.initial_memory(1) if self._state is None else read_memory(self._state)
            made = self._last[None].copy(), self._moved[None].copy()
            action, self._state = self.policy.act(batch, self.policy.recall(memory, *made))
        except Exception:
            logger.exception("The policy %s raised an error: the arm is stopped.", self.policy.name)
            self._stopped = StopReason.POLICY
            return self._brake()
        if self._state[0][0] == _DIVERGED:
            self._stopped = StopReason.POLICY
            return self._brake()
        self._made += 1
        out = np.empty_like(q)
        before = self._last, self._moved
        kernels.command(self._limits, q, action[0], self._unit, *before, self._problem.dt, self._kept, out)
        return out

    def _brake(self) -> FloatArray:
        """The next command of a stop. Shape (n,)."""
        out = np.empty_like(self._last)
        kernels.brake(self._change, self._limits[JERK], self._last, self._moved, out)
        return out

    def _play(self, calls: int) -> list[float]:
        """Durations in [s] of calls along the scenario's reference, on a perfect arm; one more compiles."""
        scenario, ahead = self._scenario, self.ahead
        spent: list[float] = []
        nominal, start = scenario.nominal(0, ahead), scenario.first_q(scenario.episode(0))
        around = scenario.replace(obstacles=scenario.obstacles_of(0)).obstacle_rows(scenario.steps + 1)
        self._touch()
        q, k = start, 0
        while len(spent) <= calls:
            shown = around[min(k + 1, len(around) - 1)] if self._problem.obstacles_shown else None
            begin = time.perf_counter()
            qdot = self.step(q, None, nominal[k + 1 : k + 1 + ahead], obstacles=shown)
            duration = time.perf_counter() - begin
            if self._stopped is None:
                spent.append(duration)
            elif k == 0 or self._stopped is StopReason.POLICY:
                raise InvalidInputError(
                    f"warm_up: expected a policy that follows the reference of scenario {scenario.name!r} within the "
                    f"guards, but {self.policy.name} is stopped in period {k + 1}: {self._stopped.label}."
                    f"{self._advice(start, nominal[1]) if k == 0 else ''}"
                )
            q, k = q + scenario.dt * qdot, k + 1
            if k == scenario.steps or self._stopped is not None:
                self.reset()
                q, k = start, 0
        return spent[1:]

    def _advice(self, start: FloatArray, nominal: FloatArray) -> str:
        """How to begin a motion whose reference is farther from the arm than the guards allow."""
        if self._stopped is not StopReason.PATH_ERROR:
            return ""
        distance, angle = kernels.errors(self._kind, nominal, self._observe_pose(None, start))
        return (
            f" The arm starts {distance:.3g} m and {angle:.3g} rad from the reference: begin on it, or allow more with "
            "guards=Guards(position_error=…, orientation_error=…)."
        )

    def _touch(self) -> None:
        """Compiles kernels that the first periods may not call: poses as rotation and position, and a stop."""
        self._observe_pose((np.eye(3), np.zeros(3)), np.zeros(self._joints))
        self._brake()
        kernels.take_report(np.zeros(self._joints), _NONE, *self._takes, self._last, self._moved)


def _age(name: str, age: float) -> float:
    """The age of a measurement in control periods; one that is not finite, or below 0, is left to the guards."""
    return age if type(age) is float else float(numbers(name, age, ()))
