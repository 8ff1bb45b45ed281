"""The formulas of the solvers by themselves, for Jacobians and task shifts of any kind."""

from __future__ import annotations

import numpy as np

from baselines.solvers.linear_algebra import pseudoinverse_rows
from baselines.solvers.resolved_rate.base import APPLIED, DEFICIENT
from baselines.solvers.resolved_rate.dls import DampedLeastSquares, damped_rows
from baselines.solvers.resolved_rate.gram_schmidt import GramSchmidt, orthonormal_rows
from baselines.solvers.resolved_rate.jacobian_transpose import JacobianTranspose, transpose_rows
from baselines.solvers.resolved_rate.null_space import move_rows, objective_rows


def invert(policy, jacobian, shift):
    """Joint shifts (B, n) for task shifts (B, e), and statuses (B,)."""
    rows, size, n = jacobian.shape
    numbers, out, deficient = policy.numbers(), np.empty((rows, n)), np.zeros(rows, dtype=np.bool_)
    if isinstance(policy, DampedLeastSquares):
        damped_rows(jacobian, shift, numbers.damping, out)
    elif isinstance(policy, GramSchmidt):
        orthonormal_rows(jacobian, shift, numbers.truncation, numbers.full_rank, out, deficient)
    elif isinstance(policy, JacobianTranspose):
        transpose_rows(jacobian, shift, numbers.weights, numbers.tolerance, out, deficient)
        deficient &= size == numbers.full_rank
    else:
        pseudoinverse_rows(jacobian / numbers.root, shift, numbers.tolerance, numbers.full_rank, out, deficient)
        out /= numbers.root
    return out, np.where(deficient, DEFICIENT, APPLIED)


def move(policy, q, jacobian, shift):
    """The same of `null_space`, at joint coordinates (B, n)."""
    out, status = np.empty_like(q), np.empty(len(q), dtype=np.int64)
    move_rows(policy.problem.model.chain, policy.numbers(), q, jacobian, shift, out, status)
    return out, status


def objective_gradient(policy, q):
    """Its secondary objective's z / K, of shape (B, n)."""
    out = np.empty_like(q)
    objective_rows(policy.problem.model.chain, policy.numbers(), q, out)
    return out
