"""The state of the viewer, without a server: joints moved by hand, a target to follow, or an episode."""

from __future__ import annotations

import enum
import time
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from baselines.status import Status
from baselines.viewer.approach import Approach, Pose
from baselines.viewer.following import Follower
from baselines.viewer.readings import Reader, Reading
from baselines.viewer.replay import Replay, Stage
from ikgym.validation import FloatArray

#: The status of a policy that cannot follow a target.
PLAYS_ONLY = "plays the episode only"
# Wall time in [s] that policies may take per update of the scene.
BUDGET = 0.05


class Mode(enum.Enum):
    """The source of motion."""

    HAND = "joints by hand"
    FOLLOW = "following the target"
    PLAY = "episode"


class Shown(NamedTuple):
    """The arm of one policy at one time.

    Attributes:
        policy: The name of the policy.
        q: Joint coordinates in [rad] or [m]. Shape (n,).
        position_error: Distance from the reference in [m], NaN without one.
        orientation_error: Angle in [rad], NaN also if the task has no orientation.
        cost: Accumulated cost of the episode, NaN outside of it.
        status: Status of the policy's last step.
        reading: Manipulability and limits.
    """

    policy: str
    q: FloatArray
    position_error: float
    orientation_error: float
    cost: float
    status: str
    reading: Reading


class Session:
    """The state of the viewer.

    Args:
        stage: The episode.
        replays: The replays of the policies.
        followers: Their followers, None for policies that cannot follow a target.
    """

    def __init__(self, stage: Stage, replays: Sequence[Replay], followers: Sequence[Follower | None]) -> None:
        self.stage, self.replays, self._followers = stage, list(replays), list(followers)
        self._reader = Reader(stage.scenario.arm, stage.scenario.task)
        self._approach = Approach(stage.pose(0), *stage.pace)
        self._q = [replay.q[0] for replay in self.replays]
        self.duration = float(self.replays[0].times[-1])
        self.mode, self.playing, self.time, self.speed = Mode.PLAY, False, 0.0, 1.0
        #: Share of real time that the policies reach while they follow the target.
        self.kept = 1.0
        self._due = 0.0

    @property
    def step(self) -> int:
        """The step of the episode that is shown."""
        return min(round(self.time / self.stage.scenario.dt), self.stage.scenario.steps)

    @property
    def reference(self) -> Pose:
        """The pose of the reference."""
        return self.stage.pose(self.step) if self.mode is Mode.PLAY else self._approach.pose

    def place(self, q: FloatArray) -> None:
        """Puts all arms at a posture, and the target at their tool.

        Args:
            q: Joint coordinates in [rad] or [m]; cut to the limits. Shape (n,).
        """
        arm = self.stage.scenario.arm
        posture = np.clip(q, arm.lower, arm.upper)
        self._leave(Mode.HAND, Pose(*arm.forward(posture)), [posture] * len(self._q))

    def aim(self, target: Pose) -> None:
        """Moves the target; the arms follow it from where they are."""
        if self.mode is not Mode.FOLLOW:
            self._leave(Mode.FOLLOW, self.reference, [one.q for one in self.shown()])
        self._approach.aim(target)

    def toggle(self) -> None:
        """Plays or pauses the episode; it starts again if it has ended or was not shown."""
        if self.mode is not Mode.PLAY or self.time >= self.duration:
            self.time, self.playing = 0.0, False
        self.mode, self.playing = Mode.PLAY, not self.playing

    def scrub(self, moment: float) -> None:
        """Shows the episode at a time in [s], and pauses it."""
        self.mode, self.playing = Mode.PLAY, False
        self.time = float(np.clip(moment, 0.0, self.duration))

    def advance(self, seconds: float) -> None:
        """Advances the time.

        Args:
            seconds: Since the last call, in [s].
        """
        if self.mode is Mode.FOLLOW:
            self._follow(seconds * self.speed)
        elif self.playing:
            self.time = min(self.time + seconds * self.speed, self.duration)
            self.playing = self.time < self.duration

    def shown(self) -> list[Shown]:
        """The arm of each policy now."""
        return [self._shown(number) for number in range(len(self.replays))]

    def _leave(self, mode: Mode, reference: Pose, postures: Sequence[FloatArray]) -> None:
        """Changes the mode, with the arms at the given postures."""
        self.mode, self.playing, self._due, self.kept = mode, False, 0.0, 1.0
        self._approach.place(reference)
        self._q = list(postures)
        for follower, posture in zip(self._followers, postures, strict=True):
            if follower is not None:
                follower.place(posture)

    def _follow(self, seconds: float) -> None:
        """Makes the steps that are due, within the budget of time."""
        self._due += seconds / self.stage.scenario.dt
        due, made, end = int(self._due), 0, time.perf_counter() + BUDGET
        while made < due and time.perf_counter() < end:
            for follower in self._followers:
                if follower is not None:
                    follower.step(self._approach)
            self._approach.advance()
            made += 1
        if due:
            self.kept += 0.2 * (made / due - self.kept)  # smoothed, to be read
        self._due -= due

    def _shown(self, number: int) -> Shown:
        replay, follower = self.replays[number], self._followers[number]
        position, orientation, cost = np.nan, np.nan, np.nan
        if self.mode is Mode.PLAY:
            k = self.step
            q, status = replay.q[k], Status(int(replay.statuses[k])).label
            position, orientation, cost = replay.position_error[k], replay.orientation_error[k], replay.cost[k]
        elif follower is None:
            q, status = self._q[number], PLAYS_ONLY
        else:
            q, status = follower.q, follower.status
            position, orientation = follower.errors(self._approach)
        return Shown(replay.policy, q, float(position), float(orientation), float(cost), status, self._reader.read(q))
