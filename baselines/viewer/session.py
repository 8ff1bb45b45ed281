"""What the viewer shows, moment by moment, without a server: postures by hand, a target to follow, an episode."""

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
# Wall time in [s] that policies may take before the next picture is due.
BUDGET = 0.05


class Mode(enum.Enum):
    """What moves the arms."""

    HAND = "joints by hand"
    FOLLOW = "following the target"
    PLAY = "episode"


class Shown(NamedTuple):
    """One policy's arm at a moment.

    Attributes:
        policy: The name of the policy.
        q: Joint coordinates in [rad] or [m]. Shape (n,).
        position_error: Distance from the reference in [m], NaN where the arm follows none.
        orientation_error: Angle in [rad], NaN as well where the task has no orientation.
        cost: What the episode has cost so far, NaN outside of it.
        status: How the last step of the policy went.
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
    """The state behind the picture.

    Args:
        stage: What policies are shown on.
        replays: The episode, as each policy played it.
        followers: Who follows a target, None for policies that cannot; in the same order.
    """

    def __init__(self, stage: Stage, replays: Sequence[Replay], followers: Sequence[Follower | None]) -> None:
        self.stage, self.replays, self._followers = stage, list(replays), list(followers)
        self._reader = Reader(stage.scenario.arm, stage.scenario.task)
        self._approach = Approach(stage.pose(0), *stage.pace)
        self._q = [replay.q[0] for replay in self.replays]
        self.duration = float(self.replays[0].times[-1])
        self.mode, self.playing, self.time, self.speed = Mode.PLAY, False, 0.0, 1.0
        #: Which share of the speed asked for the policies keep up with.
        self.kept = 1.0
        self._due = 0.0

    @property
    def step(self) -> int:
        """Which step of the episode is shown."""
        return min(round(self.time / self.stage.scenario.dt), self.stage.scenario.steps)

    @property
    def reference(self) -> Pose:
        """Where the tool is to be."""
        return self.stage.pose(self.step) if self.mode is Mode.PLAY else self._approach.pose

    def place(self, q: FloatArray) -> None:
        """Puts all arms at a posture, and the target where their tool is.

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
        """Plays the episode, from the start where it had ended or was not shown, or pauses it."""
        if self.mode is not Mode.PLAY or self.time >= self.duration:
            self.time, self.playing = 0.0, False
        self.mode, self.playing = Mode.PLAY, not self.playing

    def scrub(self, moment: float) -> None:
        """Shows the episode at a time in [s], and pauses it."""
        self.mode, self.playing = Mode.PLAY, False
        self.time = float(np.clip(moment, 0.0, self.duration))

    def advance(self, seconds: float) -> None:
        """Lets time pass.

        Args:
            seconds: Since the last call, in [s].
        """
        if self.mode is Mode.FOLLOW:
            self._follow(seconds * self.speed)
        elif self.playing:
            self.time = min(self.time + seconds * self.speed, self.duration)
            self.playing = self.time < self.duration

    def shown(self) -> list[Shown]:
        """What is to be seen of each policy now."""
        return [self._shown(number) for number in range(len(self.replays))]

    def _leave(self, mode: Mode, reference: Pose, postures: Sequence[FloatArray]) -> None:
        """Leaves the mode that was, for arms that stand at postures."""
        self.mode, self.playing, self._due, self.kept = mode, False, 0.0, 1.0
        self._approach.place(reference)
        self._q = list(postures)
        for follower, posture in zip(self._followers, postures, strict=True):
            if follower is not None:
                follower.place(posture)

    def _follow(self, seconds: float) -> None:
        """Makes the steps that are due, as many as there is time for."""
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
