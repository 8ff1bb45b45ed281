"""Constants and bounds of drives of low order and of resonances."""

from __future__ import annotations

import math
from typing import NamedTuple, Self

import numpy as np

from ikgym.plant.checks import COMMANDS, VELOCITIES
from ikgym.plant.plant import Plant
from ikgym.validation import FloatArray

#: Velocities and commands that a drive of low order remembers.
PAST = VELOCITIES + COMMANDS - 1
#: Share of its largest value below which an impulse response is over.
OVER = 1e-12


class Response(NamedTuple):
    """Drives of low order and resonances of all joints.

    Attributes:
        coefficients: See :attr:`Plant.drive`. Shape (n, 7), or (0, 7) without.
        free: See :func:`ikgym.plant.drive_kernels.swing_link`. Shape (n, 4), or (0, 4) without resonances.
        steady: Velocity of a drive of low order after a long time of a command, in parts of it. Shape (n,).
    """

    coefficients: FloatArray
    free: FloatArray
    steady: FloatArray

    @classmethod
    def of(cls, plant: Plant, joints: int, dt: float) -> Self:
        """Those of a plant, with a number of joints and Δt in [s]."""
        rows, steady = np.empty((0, VELOCITIES + COMMANDS)), np.ones(joints)
        if plant.drive:
            rows = np.array(np.broadcast_to(plant.drive, (joints, VELOCITIES + COMMANDS)), dtype=np.float64)
            steady = rows[:, VELOCITIES:].sum(axis=1) / (1.0 - rows[:, :VELOCITIES].sum(axis=1))
        return cls(rows, _free(plant, joints, dt), steady)


def fastest(plant: Plant, velocity: FloatArray) -> FloatArray:
    """Largest velocities of the drives in [rad/s] or [m/s], for largest commands. Shapes (n,).

    Drives of low order overshoot at most by the sum of the absolute values of their impulse response.
    """
    response, most = Response.of(plant, len(velocity), 1.0), np.ones(len(velocity))
    if plant.drive:
        rows, past = response.coefficients, np.zeros((len(velocity), VELOCITIES))
        most, k, peak = np.zeros(len(velocity)), 0, 0.0
        while k < COMMANDS or np.abs(past).max() > OVER * peak:
            now = (rows[:, :VELOCITIES] * past).sum(axis=1) + (rows[:, VELOCITIES + k] if k < COMMANDS else 0.0)
            past = np.column_stack([now, past[:, :-1]])
            most, k, peak = most + np.abs(now), k + 1, max(peak, float(np.abs(now).max()))
    return velocity * most * plant.gain + np.abs(plant.bias) + plant.noise


def deflection(plant: Plant, velocity: FloatArray, dt: float) -> FloatArray:
    """Largest deflections of resonances in [rad] or [m], for largest commands and Δt in [s]. Shapes (n,).

    Each change of the velocity starts a swing of at most change / ω_d, which fades by exp(−ζ ω Δt) in a step.
    """
    omega, damping = _omega(plant, len(velocity))
    with np.errstate(invalid="ignore", divide="ignore"):
        most = 2.0 * fastest(plant, velocity) / (omega * np.sqrt(1.0 - damping**2) * -np.expm1(-damping * omega * dt))
    return np.where(np.isinf(omega), 0.0, most)


def _omega(plant: Plant, joints: int) -> tuple[FloatArray, FloatArray]:
    """ω in [rad/s] and ζ of the resonances. Shapes (n,)."""
    frequency, damping = (np.broadcast_to(value, joints) for value in (plant.resonance, plant.resonance_damping))
    return 2.0 * math.pi * frequency, np.asarray(damping, dtype=np.float64)


def _free(plant: Plant, joints: int, dt: float) -> FloatArray:
    omega, damping = _omega(plant, joints)
    if np.isinf(omega).all():
        return np.empty((0, 4))
    finite = np.where(np.isinf(omega), 1.0, omega)
    damped = finite * np.sqrt(1.0 - damping**2)
    c, s, fade = np.cos(damped * dt), np.sin(damped * dt), np.exp(-damping * finite * dt)
    along = damping * finite / damped * s
    free = np.column_stack([c + along, s / damped, -(finite**2) / damped * s, c - along])
    return np.where(np.isinf(omega)[:, None], 0.0, fade[:, None] * free)
