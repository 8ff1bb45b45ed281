"""A mock arm that refuses what a real one refuses: limits of commands, lost messages, joints that run into stops."""

from __future__ import annotations

import contextlib
import enum
import multiprocessing
import time
from typing import Any, NamedTuple, Self

import numpy as np
import numpy.typing as npt
from gymnasium.utils import seeding

from baselines.controller import kernels
from baselines.controller.reference import numbers
from baselines.controller.timing import use_real_time_priority
from ikgym import scenarios
from ikgym.exceptions import InvalidInputError
from ikgym.kernels.outcome import Outcome
from ikgym.scenarios import Scenario
from ikgym.simulator import Simulator
from ikgym.validation import FloatArray, number, whole_number

#: Messages in a row that may be lost, and the share of a period after which one counts as lost: those of libfranka.
MOST_LOST, DEADLINE = 20, 0.3
#: Commands may exceed their limits by this share, and by a rounding in [rad/s] or [m/s].
SLACK, ROUNDING = 1e-3, 1e-9
#: Most periods of an arm: 1,000 s at 1 kHz.
MOST_PERIODS = 1_000_000


class Reflex(enum.StrEnum):
    """Why an arm has stopped itself."""

    VELOCITY = "a commanded velocity is above its limit"
    ACCELERATION = "the commanded velocity jumps: its acceleration is above the limit"
    JERK = "the commanded acceleration jumps: its jerk is above the limit"
    COMMUNICATION = "too many messages in a row are lost or late"
    POSITION = "a joint comes near its stop too fast to brake"
    NOT_FINITE = "a command is not finite"


#: Reflexes in the order of :func:`baselines.controller.kernels.refused`.
REFLEXES = None, Reflex.NOT_FINITE, Reflex.VELOCITY, Reflex.ACCELERATION, Reflex.JERK, Reflex.POSITION


class State(NamedTuple):
    """What the arm reports in each period.

    Attributes:
        time: Since the start, in [s].
        q: Measured joint coordinates in [rad] or [m]. Shape (n,).
        commanded: The joint velocities that it has taken for the last command, in [rad/s] or [m/s]: where a message was
            lost, the velocity before, changed as in the period before. Shape (n,).
        commanded_acceleration: By how much these differ from those before, divided by the period, in [rad/s²] or
            [m/s²]. Shape (n,).
        reflex: Why the arm has stopped itself; None if it has not.
    """

    time: float
    q: FloatArray
    commanded: FloatArray
    commanded_acceleration: FloatArray
    reflex: Reflex | None


class ArmInterface:
    """The arm's side of the interface, one period after the other, in simulated time.

    Args:
        scenario: Arm, drives and encoders (its plant), and the period Δt, as :func:`ikgym.scenarios.find` takes it.
        jitter: Standard deviation of the delay of a message, as a share of the period. A message that is later than 0.3
            periods is lost.
        lost: Share of the messages that are lost.
        seed: Of drives, noise, jitter and lost messages.

    Raises:
        InvalidInputError: A number is out of its range.
    """

    def __init__(self, scenario: str | Scenario, *, jitter: float = 0.0, lost: float = 0.0, seed: int = 0) -> None:
        self.scenario = scenarios.find(scenario)
        self._jitter = number("jitter", jitter, at_least=0.0)
        self._lost = number("lost", lost, at_least=0.0, at_most=1.0)
        seed = whole_number("seed", seed, at_least=0)
        self._rng = np.random.default_rng([seed, 1])
        endless = {"steps": MOST_PERIODS, "iterations_per_point": MOST_PERIODS}  # the reference is not used
        self._simulator = Simulator(self.scenario.replace(collisions=False, obstacles=(), **endless), None, 1)
        drawn = [seeding.np_random(seed)[0]]
        self._out: Outcome = self._reset(drawn)
        n, arm, dt = self.scenario.joints, self.scenario.arm, self.scenario.dt
        self._command, self._change = np.zeros(n), np.zeros(n)
        self._periods, self._missed = 0, 0
        self._reflex: Reflex | None = None
        self._braking = np.array([dt * arm.acceleration_limit, dt * dt * arm.jerk_limit])
        self._bounds = np.array([arm.velocity_limit, *self._braking])
        self._bounds = (1.0 + SLACK) * self._bounds + ROUNDING
        self._stops = np.array([arm.lower, arm.upper, arm.acceleration_limit])

    def _reset(self, generators: list[np.random.Generator]) -> Outcome:
        self._simulator.reset(np.ones(1, dtype=np.bool_), generators)
        return self._simulator.observe()

    @property
    def state(self) -> State:
        """The state at the end of the last period."""
        dt = self.scenario.dt
        return State(self._periods * dt, self._out.q[0].copy(), self._command.copy(), self._change / dt, self._reflex)

    @property
    def true_q(self) -> FloatArray:
        """The true joint coordinates in [rad] or [m]. Shape (n,)."""
        q: FloatArray = self._simulator.true_q[0]
        return q

    def cycle(self, command: npt.ArrayLike | None) -> State:
        """One period.

        Args:
            command: The message of this period: joint velocities in [rad/s] or [m/s], of shape (n,); None where there
                is none.

        Raises:
            InvalidInputError: The shape is another one.
        """
        if command is not None:
            command = numbers("command", command, self._command.shape)
        late = self._jitter * abs(self._rng.standard_normal()) > DEADLINE
        if command is None or late or self._rng.random() < self._lost:
            self._missed += 1
            wanted = self._command + self._change
            limit = self.scenario.arm.velocity_limit
            wanted = np.clip(wanted, -limit, limit)
        else:
            self._missed, wanted = 0, command.copy()
        if self._reflex is None:
            self._reflex = self._find_reflex(wanted)
        if self._reflex is not None:  # brakes as hard as it can
            most = np.minimum(self._bounds[1], np.abs(self._command))
            wanted = self._command - np.copysign(most, self._command)
        return self._move(wanted)

    def brake(self) -> State:
        """One period of a stop within the limits of acceleration and jerk."""
        wanted = np.empty_like(self._command)
        kernels.brake(*self._braking, self._command.copy(), self._change.copy(), wanted)
        return self._move(wanted)

    def _move(self, wanted: FloatArray) -> State:
        if self._periods >= MOST_PERIODS:
            raise InvalidInputError(f"expected at most {MOST_PERIODS:,} periods of a mock arm.")
        self._change, self._command = wanted - self._command, wanted
        self._out = self._simulator.step(wanted / self.scenario.velocity_limit)
        self._periods += 1
        return self.state

    def _find_reflex(self, wanted: FloatArray) -> Reflex | None:
        """The reflex that a command starts; None if it is fine."""
        if self._missed > MOST_LOST:
            return Reflex.COMMUNICATION
        before, state, dt = (self._command, self._change), (self.true_q, self._out.qdot[0]), self.scenario.dt
        return REFLEXES[kernels.find_broken_limit(self._bounds, self._stops, wanted, *before, *state, dt)]


class MockArm:
    """An arm at the other end of a connection: a separate process that keeps its period, whatever its user does.

    >>> with MockArm("panda-circle") as arm:
    ...     state = arm.read()
    ...     arm.write(np.zeros(7))

    Args:
        scenario: See :class:`ArmInterface`; likewise ``jitter``, ``lost`` and ``seed``.
        real_time: Whether it is a process that runs in real time: a script that makes one needs the line ``if __name__
            == "__main__":``, since the new process imports the script. If not, :meth:`read` makes one period, with the
            command that was written since the last one: for many runs in little time, with the same code.

    Raises:
        InvalidInputError: A number is out of its range.
    """

    def __init__(self, scenario: str | Scenario, *, real_time: bool = True, **options: Any) -> None:
        self._interface = ArmInterface(scenario, **options)
        self._joints, self._begun, self._on = self._interface.scenario.joints, False, True
        self._command: FloatArray | None = None
        self._pipe: Any = None
        self._process: Any = None
        self._read_at = 0.0
        if real_time:
            context = multiprocessing.get_context("spawn")
            self._pipe, far = context.Pipe()
            arguments = far, self._interface.scenario, options
            self._process = context.Process(target=_run, args=arguments, daemon=True)
            self._process.start()
            far.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def read(self) -> State:
        """The newest state; waits for it in real time.

        Raises:
            InvalidInputError: The arm was switched off.
        """
        self._check("read")
        if self._process is None:
            begun, self._begun = self._begun, True
            command, self._command = self._command, None
            return self._interface.cycle(command) if begun else self._interface.state
        try:
            state: State = self._pipe.recv()
            while self._pipe.poll():
                state = self._pipe.recv()
        except (EOFError, OSError):
            self._on = False
            self._check("read")
        self._read_at = state.time
        return state

    def write(self, qdot: npt.ArrayLike) -> None:
        """Sends joint velocities in [rad/s] or [m/s]. Shape (n,).

        Raises:
            InvalidInputError: The shape is another one, or the arm was switched off.
        """
        command = numbers("qdot", qdot, (self._joints,))
        self._check("write")
        if self._process is None:
            self._command = command.copy()
            return
        try:
            self._pipe.send((self._read_at, command))
        except OSError:
            self._on = False
            self._check("write")

    def stop(self) -> State | None:
        """Brings the arm to rest within the limits of acceleration and jerk, and switches it off.

        Returns:
            The last state; None if the arm is off already.
        """
        state: State | None = None
        if self._on and self._process is None:
            state = self._interface.state
            while state.commanded.any():
                state = self._interface.brake()
        elif self._on:
            with contextlib.suppress(EOFError, OSError):
                self._pipe.send((self._read_at, None))
                while self._pipe.poll(5.0):
                    state = self._pipe.recv()
        self._on = False
        if self._process is not None:
            self._pipe.close()
            self._process.join(5.0)
            self._process.kill()
        return state

    def _check(self, name: str) -> None:
        if not self._on:
            raise InvalidInputError(f"{name}: expected an arm that is switched on.")


def _run(pipe: Any, scenario: Scenario, options: dict[str, Any]) -> None:
    """The process of an arm: a period after the other in real time, with the command that answers the last state."""
    arm = ArmInterface(scenario, **options)
    arm.cycle(np.zeros(scenario.joints))  # compiles
    arm, period = ArmInterface(scenario, **options), scenario.dt
    state, begun, stopping = arm.state, False, False
    use_real_time_priority()
    try:
        pipe.send(state)
        due = time.perf_counter()
        while not stopping or state.commanded.any():
            if not begun:  # the pipe is full while nobody reads
                due = time.perf_counter()
            due += period
            command = None
            while (left := due - time.perf_counter()) > 0.0 or pipe.poll():
                if pipe.poll(max(left, 0.0)):
                    stamp, message = pipe.recv()
                    stopping = stopping or message is None
                    if stamp == state.time or not begun:  # one that was made for an earlier state is late
                        command = message
            begun = begun or command is not None  # nobody is late before the first command
            state = arm.brake() if stopping else arm.cycle(command if begun else np.zeros(scenario.joints))
            pipe.send(state)
    except (EOFError, OSError):
        return
