"""The scenarios of the four papers, and random ones for learning."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ikgym import arms, tasks
from ikgym.scenarios.scenario import Scenario
from ikgym.trajectories import Helix, RandomSinusoid, Sinusoid, StraightLine, Trajectory

VARGA_AMPLITUDE = np.array([0.8, 1.0, 1.2, 1.4, 1.6, 1.8, 2.0])
VARGA_FAST = Sinusoid(VARGA_AMPLITUDE, frequency=3.0)
VARGA_SLOW = Sinusoid(0.5 * VARGA_AMPLITUDE, frequency=3.0, sigmoid=0.3)
VARGA_RANDOM = RandomSinusoid(VARGA_AMPLITUDE, scale=(0.2, 1.0), frequency=(1.0, 3.0))


def _varga(name: str, arm: str, trajectory: Trajectory, steps: int, source: str, task: str = "skew") -> Scenario:
    return Scenario(
        name,
        arms.get(arm),
        tasks.get(task),
        trajectory,
        velocity_limit=np.full(7, 20.0),
        steps=steps,
        source=source,
    )


def _faitli(name: str, trajectory: Trajectory) -> Scenario:
    """The paper prints no trajectory; t runs from 0 to 2π."""
    return Scenario(
        name,
        arms.get("faitli3"),
        tasks.get("position"),
        trajectory,
        velocity_limit=np.full(3, 50.0),
        steps=6283,
        source="Faitli 2018; trajectory of this project",
    )


def _khan(name: str, amplitude: list[float], frequency: list[float]) -> Scenario:
    """The nominal path runs over s = 0 … 10 on the approximate arm, which is all that solvers know."""
    points, first, usual = 10_000, 60, 10
    return Scenario(
        name,
        arms.get("khan8"),
        tasks.get("matrix"),
        Sinusoid(np.array(amplitude), np.array(frequency)),
        velocity_limit=np.full(8, 50.0),
        model=arms.get("khan8_approximate"),
        iterations_per_point=(first,) * 10 + (usual,),
        steps=10 * first + (points - 10) * usual,
        source="Khan 2020, section 4",
    )


def _planar() -> Scenario:
    """Bent between 0.5 and 1.1 rad, so that both eigenvalues of ∂(x, y)/∂q keep negative real parts (eq. 2.6)."""
    return Scenario(
        "planar2-bent",
        arms.get("planar2"),
        tasks.get("position"),
        _sines([0.3, 0.3], [np.pi, 2 * np.pi], [0.0, 0.0], [1.2, 0.8]),
        velocity_limit=np.full(2, 50.0),
        iterations_per_point=10,
        steps=20_000,
        source="Khan 2020, section 2: the arm with 2 joints; trajectory of this project",
    )


def _zhang_helix() -> Scenario:
    """Sample times 1 … 800; the first measurement is 0, although q = 0 says otherwise."""
    return Scenario(
        "zhang3-helix",
        arms.get("zhang3"),
        tasks.get("position"),
        Helix(center=np.array([4.0, 0.0, 5.0]), radius=3.0, frequency=np.pi / 50, climb=1 / 200, start=1.0),
        velocity_limit=np.full(3, 10.0),
        dt=1.0,
        steps=799,
        start=np.zeros(3),
        initial_pose=np.zeros(3),
        source="Zhang 2020, example 1",
    )


def _zhang_line() -> Scenario:
    arm = arms.get("puma560")
    q_a = np.array([-np.pi / 4, np.pi / 6, 0.0, 0.0, -np.pi / 4, 0.0])
    q_b = np.array([np.pi / 4, np.pi / 6, 0.0, 0.0, -np.pi / 4, 0.0])
    a, b = (np.concatenate([part.ravel() for part in arm.forward(q)]) for q in (q_a, q_b))
    return Scenario(
        "zhang6-lspb",
        arm,
        tasks.get("pose"),
        StraightLine(a, b, duration=2.0, blend=0.5),
        velocity_limit=np.full(6, 20.0),
        steps=2000,
        start=q_a,
        source="Zhang 2020, example 2, with the Puma 560 standing in",
    )


def _sines(amplitude: list[float], frequency: list[float], phase: list[float], offset: list[float]) -> Sinusoid:
    return Sinusoid(np.array(amplitude), np.array(frequency), np.array(phase), np.array(offset))


SCENARIOS: dict[str, Callable[[], Scenario]] = {
    "varga7-fast": lambda: _varga("varga7-fast", "varga7", VARGA_FAST, 3000, "Varga 2021, eq. 11"),
    "varga7-slow": lambda: _varga("varga7-slow", "varga7", VARGA_SLOW, 3000, "Varga 2021, eq. 12"),
    "varga7-literal-fast": lambda: _varga(
        "varga7-literal-fast", "varga7_literal", VARGA_FAST, 3000, "Varga 2021, eq. 11, eq. 6 read literally"
    ),
    "varga7-literal-slow": lambda: _varga(
        "varga7-literal-slow", "varga7_literal", VARGA_SLOW, 3000, "Varga 2021, eq. 12, eq. 6 read literally"
    ),
    "varga7-random": lambda: _varga("varga7-random", "varga7", VARGA_RANDOM, 1000, "amplitudes of Varga 2021, eq. 11"),
    "varga7-random-long": lambda: _varga(
        "varga7-random-long", "varga7", VARGA_RANDOM, 3000, "amplitudes of Varga 2021, eq. 11"
    ),
    # The same motions, with an orientation that cannot be mistaken: skew coordinates are the same for θ and 180° - θ.
    "varga7-pose-random": lambda: _varga(
        "varga7-pose-random", "varga7", VARGA_RANDOM, 1000, "amplitudes of Varga 2021, eq. 11", task="pose"
    ),
    "varga7-pose-random-long": lambda: _varga(
        "varga7-pose-random-long", "varga7", VARGA_RANDOM, 3000, "amplitudes of Varga 2021, eq. 11", task="pose"
    ),
    # q = (sin t, .3 + .5 sin 2t, .2 + .8 sin(3t + .5)): passes the stretched elbow.
    "faitli3-stretched": lambda: _faitli(
        "faitli3-stretched", _sines([1.0, 0.5, 0.8], [1.0, 2.0, 3.0], [0.0, 0.0, 0.5], [0.0, 0.3, 0.2])
    ),
    # q = (sin t, .3 + .5 sin 2t, 1 + .5 sin 3t): stays clear of it.
    "faitli3-regular": lambda: _faitli(
        "faitli3-regular", _sines([1.0, 0.5, 0.5], [1.0, 2.0, 3.0], [0.0, 0.0, 0.0], [0.0, 0.3, 1.0])
    ),
    # q = (.5 sin t, -.8 - .7 sin t, -1 + .3 sin 2t): passes above the shoulder.
    "faitli3-shoulder": lambda: _faitli(
        "faitli3-shoulder", _sines([0.5, -0.7, 0.3], [1.0, 1.0, 2.0], [0.0, 0.0, 0.0], [0.0, -0.8, -1.0])
    ),
    "khan8-q1": lambda: _khan("khan8-q1", [0.5, 0, 0, 0, 0, 0, 0, 0], [1, 1, 1, 1, 1, 1, 1, 1]),
    "khan8-q7q8": lambda: _khan("khan8-q7q8", [0, 0, 0, 0, 0, 0, 0.5, 0.5], [1, 1, 1, 1, 1, 1, 1, 2]),
    "planar2-bent": _planar,
    "zhang3-helix": _zhang_helix,
    "zhang6-lspb": _zhang_line,
}
