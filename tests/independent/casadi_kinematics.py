"""The arm, its task coordinates and their error as symbols of CasADi."""

from __future__ import annotations

import functools
from typing import Any

import casadi

from baselines.policy import Problem
from ikgym.arms import Arm
from ikgym.kernels.axes import SINGULAR


@functools.lru_cache(maxsize=64)
def residual(problem: Problem) -> Any:
    """The error in units of Δx as a function of joint coordinates (n,) and nominal task coordinates (m,), or (…, K)."""
    q, nominal = casadi.SX.sym("q", problem.model.joints), casadi.SX.sym("nominal", problem.task.size)
    r = error(problem.task.name, nominal, *forward(problem.model, q)) / problem.cost.delta_x
    return casadi.Function("residual", [q, nominal], [r])


def forward(arm: Arm, q: Any) -> tuple[Any, Any]:
    """Rotation (3, 3) and position (3,) in [m] of the tool at symbolic joint coordinates (Varga 2021, eq. 6)."""
    rotation, position = casadi.SX.eye(3), casadi.SX.zeros(3)
    for i in range(arm.joints):
        offset, axis = casadi.DM(arm.offsets[i]), casadi.DM(arm.axes[i])
        if arm.prismatic[i]:
            position += rotation @ (offset + q[i] * axis)
        else:
            position += rotation @ offset
            cross = casadi.skew(axis)
            turn = casadi.DM.eye(3) + casadi.sin(q[i]) * cross + (1.0 - casadi.cos(q[i])) * (cross @ cross)
            rotation = rotation @ turn  # eq. 8
    return rotation @ casadi.DM(arm.tool_rotation), position + rotation @ casadi.DM(arm.tool)


def error(task: str, nominal: Any, rotation: Any, position: Any) -> Any:
    """The error of a pose, rotation (3, 3) and position (3,) in [m], with respect to nominal task coordinates (m,)."""
    if task == "position":
        return nominal - position
    if task == "skew":
        skew = (rotation - rotation.T) / 2
        return nominal - casadi.vertcat(skew[0, 1], skew[0, 2], skew[1, 2], position)
    if task == "matrix":
        return nominal - casadi.vertcat(casadi.vec(rotation.T), position)
    if task == "axis":
        return casadi.vertcat(nominal[3:] - position, _direction_error(nominal[:3], rotation[:, 2]))
    return casadi.vertcat(nominal[9:] - position, _rotation_vector(casadi.reshape(nominal[:9], 3, 3).T @ rotation.T))


def _rotation_vector(turn: Any) -> Any:
    """Rotation vector in [rad], smooth for angles below π: by the quaternion, whose vector part is sin(θ/2) n."""
    w = casadi.sqrt(1.0 + casadi.trace(turn)) / 2
    v = _axial(turn) / (4 * w)
    square = casadi.sumsqr(v)
    # θ / sin(θ/2) is 0/0 at 0: a series there, and the square root kept away from 0 in the branch not taken.
    sine = casadi.sqrt(casadi.fmax(square, 1e-4))
    series = 2 + square * (1 / 3 + square * (3 / 20 + square * (5 / 56 + square * 35 / 576)))
    return casadi.if_else(square < 1e-4, series, 2 * casadi.atan2(sine, w) / sine) * v


def _direction_error(nominal: Any, here: Any) -> Any:
    """The rotation vector from an axis to its nominal one, along the two directions across the latter, below π."""
    reference, first = -casadi.DM(SINGULAR), casadi.DM([1.0, -1.0, 0.0]) / 2**0.5
    cross = casadi.skew(casadi.cross(reference, nominal))
    carried = casadi.DM.eye(3) + cross + cross @ cross / (1.0 + casadi.dot(reference, nominal))
    sine = casadi.cross(here, nominal)
    square = casadi.sumsqr(sine)
    # θ / sin θ is 0/0 at 0: a series there, and the square root kept away from 0 in the branch not taken.
    length = casadi.sqrt(casadi.fmax(square, 1e-4))
    series = 1 + square * (1 / 6 + square * (3 / 40 + square * (5 / 112 + square * 35 / 1152)))
    near = casadi.logic_and(square < 1e-4, casadi.dot(here, nominal) > 0)
    factor = casadi.if_else(near, series, casadi.atan2(length, casadi.dot(here, nominal)) / length)
    both = casadi.horzcat(carried @ first, carried @ casadi.cross(reference, first))
    return factor * (both.T @ sine)


def _axial(turn: Any) -> Any:
    return casadi.vertcat(turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1])
