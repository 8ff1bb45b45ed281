"""The state of the viewer, without a server: joints moved by hand, a target to follow, or an episode."""

from __future__ import annotations

import enum
import time
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from baselines.evaluation.table import escape_markdown
from baselines.status import Status
from baselines.viewer.following import Approach, follower
from baselines.viewer.readings import Reader, Reading
from baselines.viewer.replay import Stage, play_all
from ikgym.rendering.scene import Scene
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


class PolicyView(NamedTuple):
    """The arm of one policy at one time."""

    policy: str
    scene: Scene  # the arm, its surroundings and its target
    position_error: float  # distance from the reference in [m], NaN without one
    orientation_error: float  # angle in [rad], NaN also if the task has no orientation
    cost: float  # accumulated cost of the episode, NaN outside of it
    status: str  # status of the policy's last step
    reading: Reading  # manipulability and limits


class Session:
    """The state of the viewer; all policies, named as on the command line, play the episode when it is made."""

    def __init__(self, stage: Stage, policies: Sequence[str]) -> None:
        self.stage, self.replays = stage, play_all(stage, policies)
        self._followers = [follower(stage, replay.policy) for replay in self.replays]
        self._reader = Reader(stage.scenario.arm, stage.scenario.task)
        self._approach = Approach(stage)
        self._q = [stage.start for _ in self.replays]
        self.duration = stage.scenario.steps * stage.scenario.dt
        self.mode, self.playing, self.time, self.speed = Mode.PLAY, False, 0.0, 1.0
        #: Share of real time that the policies reach while they follow the target.
        self.kept = 1.0
        self._due = 0.0

    @property
    def step(self) -> int:
        """The step of the episode that is shown."""
        return min(round(self.time / self.stage.scenario.dt), self.stage.scenario.steps)

    @property
    def reference(self) -> FloatArray:
        """The reference: rotation and position in [m]. Shape (12,)."""
        return self.stage.frames[self.step] if self.mode is Mode.PLAY else self._approach.frame

    @property
    def has_bodies(self) -> bool:
        """Whether there are bodies or obstacles to show."""
        scenario = self.stage.scenario
        return bool(len(scenario.arm.bodies) or scenario.obstacles)

    def place(self, q: FloatArray) -> None:
        """Puts all arms at joint coordinates in [rad] or [m], cut to the limits, and the target at their tool. (n,)."""
        arm = self.stage.scenario.arm
        posture = np.clip(q, arm.lower, arm.upper)
        rotation, position = arm.forward(posture)
        self._leave(Mode.HAND, np.append(rotation, position), [posture] * len(self._q))

    def aim(self, target: FloatArray) -> None:
        """Moves the target; the arms follow it from where they are."""
        if self.mode is not Mode.FOLLOW:
            self._leave(Mode.FOLLOW, self.reference, [view.scene.q for view in self.views()])
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
        """Advances the time, in [s]."""
        if self.mode is Mode.FOLLOW:
            self._follow(seconds * self.speed)
        elif self.playing:
            self.time = min(self.time + seconds * self.speed, self.duration)
            self.playing = self.time < self.duration

    def views(self) -> list[PolicyView]:
        """The arm of each policy now."""
        return [self._view(number) for number in range(len(self.replays))]

    def text(self, views: Sequence[PolicyView]) -> str:
        """The readings of each policy, as Markdown."""
        moment = f"t = {self.time:.3f} s" if self.mode is Mode.PLAY else self.mode.value
        if self.mode is Mode.FOLLOW and self.kept < 0.95:
            moment += f"; the policies keep up with {self.kept:.0%} of the speed"
        return "\n\n".join([f"*{moment}*", *map(self._readings, views)])

    def _leave(self, mode: Mode, reference: FloatArray, postures: Sequence[FloatArray]) -> None:
        """Changes the mode, with the arms at the given postures."""
        self.mode, self.playing, self._due, self.kept = mode, False, 0.0, 1.0
        self._approach.place(reference)
        self._q = list(postures)
        for one, posture in zip(self._followers, postures, strict=True):
            if one is not None:
                one.place(posture)

    def _follow(self, seconds: float) -> None:
        """Makes the steps that are due, within the budget of time."""
        self._due += seconds / self.stage.scenario.dt
        due, made, end = int(self._due), 0, time.perf_counter() + BUDGET
        while made < due and time.perf_counter() < end:
            for one in self._followers:
                if one is not None:
                    one.step(self._approach)
            self._approach.advance()
            made += 1
        if due:
            self.kept += 0.2 * (made / due - self.kept)  # smoothed, to be read
        self._due -= due

    def _view(self, number: int) -> PolicyView:
        stage, replay, following = self.stage, self.replays[number], self._followers[number]
        if self.mode is Mode.PLAY:
            k = self.step
            scene, status = stage.scene(replay.q[k], k), Status(int(replay.statuses[k])).label
            errors, cost = (float(replay.position_error[k]), float(replay.orientation_error[k])), float(replay.cost[k])
        else:
            q, status = (self._q[number], PLAYS_ONLY) if following is None else (following.q, following.status)
            scene, errors, cost = stage.scene(q, self.step, self.reference), (np.nan, np.nan), np.nan
            if following is not None:
                errors = scene.errors
        return PolicyView(replay.policy, scene, *errors, cost, status, self._reader.read(scene.q))

    def _readings(self, view: PolicyView) -> str:
        """A heading and a list."""
        scenario, reading, scene = self.stage.scenario, view.reading, view.scene
        status = "" if view.status == Status.UNKNOWN.label else f": {escape_markdown(view.status)}"
        lines = [f"**{escape_markdown(view.policy)}**{status}\n"]
        errors = [(view.position_error, "mm"), (view.orientation_error, "mrad")]
        if texts := [f"{1e3 * error:.3g} {unit}" for error, unit in errors if np.isfinite(error)]:
            lines.append(f"- error {', '.join(texts)}")
        lines.append(f"- manipulability {reading.manipulability:.3g}, {reading.share:.0%} of the largest found")
        joint = int(np.argmin(reading.margins))
        if np.isfinite(reading.margins[joint]):
            margin = f"{reading.margins[joint]:.3g} {'m' if scenario.arm.prismatic[joint] else 'rad'}"
            lines.append(f"- {escape_markdown(scenario.arm.joint_names[joint])} is {margin} from its limit")
        if np.isfinite(scene.clearance):
            pair = scenario.pair_names(scene.closest.pairs[0].tolist())
            lines.append(f"- {1e3 * scene.clearance:.1f} mm between {' and '.join(map(escape_markdown, pair))}")
        if np.isfinite(view.cost):
            lines.append(f"- cost so far {view.cost:.4g}")
        return "\n".join(lines)
