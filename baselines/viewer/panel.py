"""The panel beside the scene: controls and readings."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from baselines.status import Status
from baselines.viewer.readings import slider_range
from baselines.viewer.session import Mode, Session, Shown
from ikgym.arms import Arm
from ikgym.validation import FloatArray

#: Queues a request of a browser.
Later = Callable[[Callable[[], object]], object]

#: Seconds of the episode per second.
SPEEDS = (0.02, 0.05, 0.1, 0.25, 0.5, 1.0, 2.0, 5.0, 10.0, 50.0)

# Digits behind the point of a slider's value.
DIGITS = 4

LEGEND = (
    "Drag the target, or move a joint; *Play* returns to the episode. A joint is yellow near a limit and red at it. "
    "The ball at the tool shows the manipulability, from red (singular) to green."
)


class Panel:
    """Sliders, buttons and readings.

    Args:
        server: The server of viser.
        session: The session that they control.
        later: Queues a request.
    """

    def __init__(self, server: Any, session: Session, later: Later) -> None:
        self._session, gui = session, server.gui
        scenario = session.stage.scenario
        gui.add_markdown(f"**{escaped(scenario.name)}**, seed {session.stage.seed}\n\n{LEGEND}")
        with gui.add_folder("Episode"):
            self._play = gui.add_button("Play")
            self._time = gui.add_slider("time [s]", 0.0, session.duration, session.duration / 1000.0, 0.0)
            speed = gui.add_dropdown("speed", tuple(f"{s:g}" for s in SPEEDS), initial_value="1")
        with gui.add_folder("Now"):
            self._readings = gui.add_markdown("")
        with gui.add_folder("Joints"):
            self._joints = _sliders(gui, scenario.arm, session.stage.start)
        self._play.on_click(lambda _: later(session.toggle))
        _on_user([self._time], later, session.scrub)
        _on_user([speed], later, lambda chosen: setattr(session, "speed", float(chosen)))
        _on_user(self._joints, later, lambda *q: session.place(np.array(q)))

    def show(self, shown: Sequence[Shown]) -> None:
        """Shows readings, and the joints of the first policy on the sliders."""
        session = self._session
        self._readings.content = readings(session, shown)
        self._play.label = "Pause" if session.playing else "Play"
        if session.mode is Mode.PLAY:
            _set(self._time, session.time)
        if session.mode is not Mode.HAND:
            for slider, coordinate in zip(self._joints, shown[0].q.tolist(), strict=True):
                _set(slider, min(max(coordinate, slider.min), slider.max))


def readings(session: Session, shown: Sequence[Shown]) -> str:
    """The readings of each policy, as Markdown."""
    arm = session.stage.scenario.arm
    moment = f"t = {session.time:.3f} s" if session.mode is Mode.PLAY else session.mode.value
    if session.mode is Mode.FOLLOW and session.kept < 0.95:
        moment += f"; the policies keep up with {session.kept:.0%} of the speed"
    return "\n\n".join([f"*{moment}*", *("\n".join(_said(arm, one)) for one in shown)])


def _said(arm: Arm, one: Shown) -> list[str]:
    """A heading and a list."""
    reading, errors = one.reading, []
    if np.isfinite(one.position_error):
        errors.append(f"{1e3 * one.position_error:.3g} mm")
    if np.isfinite(one.orientation_error):
        errors.append(f"{1e3 * one.orientation_error:.3g} mrad")
    known = one.status != Status.UNKNOWN.label
    said = [f"**{escaped(one.policy)}**{f': {escaped(one.status)}' if known else ''}\n"]
    if errors:
        said.append(f"- error {', '.join(errors)}")
    said.append(f"- manipulability {reading.manipulability:.3g}, {reading.share:.0%} of the largest found")
    joint = int(np.argmin(reading.margins))
    if np.isfinite(reading.margins[joint]):
        unit = "m" if arm.prismatic[joint] else "rad"
        said.append(f"- {escaped(arm.joint_names[joint])} is {reading.margins[joint]:.3g} {unit} from its limit")
    if np.isfinite(one.cost):
        said.append(f"- cost so far {one.cost:.4g}")
    return said


def escaped(text: str) -> str:
    """A name as Markdown shows it letter by letter: viser would run what stands in braces."""
    return re.sub(r"([\\`*_{}\[\]<>&#|~!])", r"\\\1", " ".join(text.split()))


def _sliders(gui: Any, arm: Arm, start: FloatArray) -> list[Any]:
    """One slider a joint, from limit to limit and at least to the start."""
    low, high = slider_range(arm)
    low, high = np.minimum(low, start), np.maximum(high, start)
    units = ["m" if prismatic else "rad" for prismatic in arm.prismatic]
    return [
        gui.add_slider(f"{name} [{unit}]", first, last, (last - first) / 1000.0, value)
        for name, unit, first, last, value in zip(
            arm.joint_names, units, low.tolist(), high.tolist(), start.tolist(), strict=True
        )
    ]


def _set(control: Any, value: float) -> None:
    """Shows a value if it differs: viser sends it in any case, and slow browsers would undo what users do."""
    if control.value != (shown := round(value, DIGITS)):
        control.value = shown


def _on_user(controls: Sequence[Any], later: Later, then: Callable[..., object]) -> None:
    """Queues a request with the values of controls when a user, not the program, has moved one of them."""

    def moved(event: Any) -> None:
        if event.client is not None:
            values = [control.value for control in controls]
            later(lambda: then(*values))

    for control in controls:
        control.on_update(moved)
