"""Random plants, and measurements on them while they follow their reference joint paths."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from baselines.agents.recurrent.kernels import linearise
from baselines.agents.recurrent.processing import Recurrent
from baselines.episodes import play
from ikgym.exceptions import InvalidInputError
from ikgym.kernels.jit import kernel
from ikgym.kernels.simulation import Outcome
from ikgym.plant import Plant
from ikgym.scenarios import Scenario
from ikgym.validation import FloatArray

#: Steps from one measurement to the next, such as those of cameras of 60 and 30 Hz.
EVERY = (1, 4, 17, 33)
#: Shares of plants with calibrated arms, with exact sensors, and with a payload.
CALIBRATED, EXACT, LOADED = 0.25, 0.25, 0.5
#: Largest change of all joint zeros by a payload, in [rad].
PAYLOAD = 1.5e-3
#: Smallest and largest noise of position and of orientation, in [m] and [rad]; largest share of lost poses.
NOISE, MISSING = (1e-4, 1.5e-3), 0.25


class Measurements(NamedTuple):
    """T measurements of each of B episodes.

    Attributes:
        error: Measured pose minus that of the model, position in [m], then rotation vector in [rad]. Shape (B, T, 6).
        true: The same of the pose without noise, which only training knows. Shape (B, T, 6).
        sensitivity: Derivatives of both with respect to the parameters of the arm. Shape (B, T, 6, p).
        arrived: Whether the measurement was not lost. Shape (B, T).
        steps: Steps from one measurement to the next. Shape (B,).
    """

    error: Tensor
    true: Tensor
    sensitivity: Tensor
    arrived: Tensor
    steps: Tensor


def draw_plant(generator: np.random.Generator, processing: Recurrent, events: int, steps: int) -> Plant:
    """A random plant.

    Args:
        generator: The generator.
        processing: Its prior is that of the arms.
        events: Measurements of an episode.
        steps: Steps of an episode.
    """
    every = int(generator.choice(EVERY))
    last = min(events * every, steps)
    size = 0.0 if generator.random() < CALIBRATED else 1.0
    exact, loaded = generator.random() < EXACT, generator.random() < LOADED
    position, rotation = np.exp(generator.uniform(math.log(NOISE[0]), math.log(NOISE[1]), 2)) * (not exact)
    payload = PAYLOAD * generator.uniform(-1.0, 1.0) * loaded
    return Plant(
        zero=size * processing.zero,
        link=size * processing.link,
        axis=size * processing.axis,
        payload=float(payload),
        payload_step=int(generator.integers(1, max(last, 2))),
        pose_every=every,
        pose_noise=float(position),
        pose_rotation_noise=float(rotation),
        pose_missing=float(generator.uniform(0.0, MISSING)) * (not exact),
    )


def measure(scenario: Scenario, seeds: Sequence[int], events: int) -> Measurements:
    """Measurements of arms that follow their reference joint paths.

    Args:
        scenario: With a camera without delay.
        seeds: The reset seeds.
        events: T, or less where the episode ends before.

    Raises:
        InvalidInputError: The scenario has no reference joint path.
    """
    every = scenario.plant.pose_every
    last = min(events, scenario.steps // every) * every
    velocity = np.stack([_velocity(scenario, seed)[:last] for seed in seeds]) / scenario.velocity_limit
    seen: list[tuple[FloatArray, FloatArray, FloatArray, FloatArray]] = []
    made = 0

    def act(out: Outcome) -> npt.NDArray[Any]:
        nonlocal made
        if made % every == 0:
            age = out.pose_age if out.pose_age.size else np.zeros((len(seeds), 1))
            seen.append((out.q.copy(), out.pose.copy(), out.true_pose.copy(), age.copy()))
        made += 1
        return velocity[:, made - 1]

    for _ in play(scenario.replace(steps=last), seeds, act, preview=1):
        pass
    q, pose, true, age = (np.ascontiguousarray(np.stack(part, axis=1)) for part in zip(*seen, strict=True))
    return _tensors(scenario, q, pose, true, age[..., 0] == 0.0)


def joined(parts: Sequence[Measurements], events: int) -> Measurements:
    """Episodes of several plants in one batch; those with fewer measurements than `events` lack the last ones."""
    padded = []
    for part in parts:
        missing = events - part.error.shape[1]
        error, true, rates = [torch.cat([x, x[:, -1:].expand(-1, missing, *x.shape[2:])], 1) for x in part[:3]]
        lost = torch.zeros(len(part.arrived), missing, dtype=torch.bool)
        arrived = torch.cat([part.arrived, lost], 1)
        padded.append(Measurements(error, true, rates, arrived, part.steps))
    return Measurements._make(torch.cat(x) for x in zip(*padded, strict=True))


def taken(measured: Measurements, rows: Tensor) -> Measurements:
    """Some episodes. Shape of `rows` (b,)."""
    return Measurements(*(x[rows] for x in measured))


def _velocity(scenario: Scenario, seed: int) -> FloatArray:
    """The joint velocities of a reference joint path. Shape (steps, n)."""
    path = scenario.nominal_joint_path(seed)
    if path is None:
        raise InvalidInputError(f"Scenario {scenario.name!r}: expected one with a reference joint path to follow.")
    out: FloatArray = np.diff(path, axis=0) / scenario.dt
    return out


def _tensors(
    scenario: Scenario, q: FloatArray, pose: FloatArray, true: FloatArray, arrived: npt.NDArray[np.bool_]
) -> Measurements:
    rows, events, n = q.shape
    error, exact = np.empty((2, rows * events, 6))
    sensitivity = np.empty((rows * events, 6, 6 * n + 3))
    flat = (q.reshape(-1, n), pose.reshape(rows * events, -1), true.reshape(rows * events, -1))
    linearise_rows(scenario.model.chain, *flat, error, exact, sensitivity)
    shaped = (x.reshape(rows, events, *x.shape[1:]) for x in (error, exact, sensitivity))
    steps = torch.full((rows,), float(scenario.plant.pose_every), dtype=torch.float64)
    return Measurements._make((*map(torch.from_numpy, (*shaped, arrived)), steps))


@kernel
def linearise_rows(chain, q, pose, true, error, exact, sensitivity):
    """:func:`linearise` of measured and of true poses, row by row."""
    for row in range(q.shape[0]):
        linearise(chain, q[row], pose[row], error[row], sensitivity[row])
        linearise(chain, q[row], true[row], exact[row], sensitivity[row])
