"""Second-order smoothing of the joint path that any policy calculates (Varga 2021, section V)."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from baselines import registry
from baselines.policy import Batch, Memory, Operations, Solution, SolverPolicy
from ikgym import task_kernels
from ikgym.exceptions import InvalidInputError, UnknownNameError
from ikgym.jit import kernel
from ikgym.kinematics import forward
from ikgym.scenarios import Preview
from ikgym.validation import FloatArray, known_names, number

FEEDBACKS = ("calculated", "measured")


@dataclasses.dataclass(frozen=True, eq=False)
class Smoothed(SolverPolicy):
    """Lets the arm follow the joint path of another policy through a filter of second order.

    The smoothed path obeys (Λ + d/dt)² qˢ = Λ² q (eq. 13). The printed eq. 16 lacks a dot; it is
    q̈ˢ = Λ² (q − qˢ) − 2Λ q̇ˢ, integrated by explicit Euler as in eq. 17: q̇ˢ(t+Δt) = q̇ˢ + Δt q̈ˢ and
    qˢ(t+Δt) = qˢ + Δt q̇ˢ(t), with the velocity from before. The arm thus is sent q̇ˢ(t), which was known a step ago.
    At the start, where the paper says nothing, qˢ = q and q̇ˢ = 0. qˢ is the measured q: roundings do not pile up.
    A constant velocity is followed 2/Λ late.

    The paper smooths the calculated q(t) afterwards, so that the calculation does not know of the smoothing. That is
    ``feedback="calculated"``: the policy inside sees the arm where its own velocities would have brought the model,
    and runs as if it were alone. What a wrong model, disturbed drives or a saturated velocity do to the pose is then
    seen by nobody, and stays. With ``"measured"`` the policy inside sees the arm as it is, and its velocities go on
    to make up q(t). The lag is then part of its loop: a resolved rate of gain g is stable where all z with
    (z − 1)(z − 1 + ΛΔt)² = −(ΛΔt)² g lie inside the unit circle, that is for g < 0.35 at ΛΔt = 0.3 and not with the
    usual 1. Receding horizons, which ask for what is missing in very few steps, blow up.

    The filter is stable for ΛΔt < 2, and does not overshoot for ΛΔt ≤ 1. Status and iterations are those of the
    policy inside. References, which know more than they see, cannot be smoothed.

    Args:
        problem: What the policy is told of the scenario.
        policy: The name of the policy inside.
        options: Its parameters; those left out have its defaults.
        relaxation: Λ in [1/s], above 0 and below 2/Δt.
        feedback: ``"calculated"`` as in the paper, or ``"measured"``.

    Raises:
        UnknownNameError: There is no such policy, parameter of it, or feedback.
        InvalidInputError: Λ is out of its range, the policy is a reference, or it refuses its parameters.
    """

    policy: str = "rhc_gradient"
    options: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    relaxation: float = 300.0
    feedback: str = "calculated"
    inner: SolverPolicy = dataclasses.field(init=False, repr=False)

    name: ClassVar[str] = "smoothed"
    composed: ClassVar[bool] = True

    def __post_init__(self) -> None:
        kind = registry.get(self.policy)
        if kind.reference:
            raise InvalidInputError(f"policy: expected one that acts on what it sees, got the reference {kind.name!r}.")
        if not isinstance(self.options, Mapping):
            raise InvalidInputError(f"options: expected the parameters of {kind.name} by name, got {self.options!r}.")
        known_names(f"parameter of {kind.name}", self.options, kind.parameter_names())
        relaxation = number("relaxation", self.relaxation, above=0.0)
        if relaxation * self.problem.dt >= 2.0:
            raise InvalidInputError(
                f"relaxation: explicit Euler is stable below 2/Δt = {2.0 / self.problem.dt:g}, got {relaxation:g}."
            )
        if self.feedback not in FEEDBACKS:
            raise UnknownNameError("feedback", self.feedback, FEEDBACKS)
        inner = kind(self.problem, **self.options)
        for field, value in {"inner": inner, "options": inner.parameters, "relaxation": relaxation}.items():
            object.__setattr__(self, field, value)

    @property
    def preview(self) -> Preview:
        """That of the policy inside."""
        return self.inner.preview

    def memory(self, rows: int) -> Memory:
        """Whether the rest is known, (B,); calculated q and q̇, and q̇ˢ, (B, n); the memory of the policy inside."""
        n = self.problem.model.joints
        own = (np.zeros((rows, n)), np.zeros((rows, n)), np.zeros((rows, n)))
        return np.zeros(rows, dtype=np.bool_), *own, *self.inner.memory(rows)

    def solve(self, batch: Batch, memory: Memory) -> Solution:
        """See :meth:`SolverPolicy.solve`."""
        known, calculated, qdot, smooth, *inside = memory
        dt, lambda_ = self.problem.dt, self.relaxation
        calculated = np.where(known[:, None], calculated, batch.q)
        seen = batch
        if self.feedback == "calculated":
            seen = batch._replace(q=calculated, qdot=np.where(known[:, None], qdot, batch.qdot))
            seen = seen._replace(pose=self._pose(calculated))
        nothing = np.zeros(len(known), dtype=np.int64)
        # Through its own predict, so that what is not finite or beyond the limit is dealt with as if it were alone.
        action, (status, iterations, *inside) = self.inner.predict(seen._asdict(), (nothing, nothing, *inside))
        velocity = action.astype(np.float64) * self.problem.velocity_limit
        # What is beyond the limit the arm will not do.
        sent = np.clip(smooth, -self.problem.velocity_limit, self.problem.velocity_limit)
        bend = lambda_**2 * (calculated - batch.q) - 2.0 * lambda_ * sent  # eq. 16
        kept = (np.ones_like(known), calculated + dt * velocity, velocity, sent + dt * bend)  # eq. 17
        return Solution(smooth.copy(), (*kept, *inside), status, iterations)

    def operations(self, state: Memory) -> Operations:
        """Those of the policy inside, which may keep count in its memory."""
        return Operations(*self._counted(self.inner.operations(self._inner_state(state))))

    def diagnostics(self, state: Memory) -> dict[str, FloatArray]:
        """What the policy inside shows of itself."""
        return self.inner.diagnostics(self._inner_state(state))

    def count(self, iterations: npt.NDArray[np.int64]) -> tuple[npt.ArrayLike, ...]:
        """Those of the policy inside."""
        return self._counted(self.inner.count(iterations))

    def _counted(self, inside: tuple[Any, ...]) -> tuple[Any, ...]:
        """What is calculated is a forward kinematics more, and no pose is measured."""
        forwards, jacobians, factorisations, measurements = inside
        if self.feedback == "measured":
            return inside
        return forwards + 1, jacobians, factorisations, measurements * 0

    def _inner_state(self, state: Memory) -> Memory:
        own = len(state) - len(self.inner.memory(1))
        return *state[:2], *state[own:]

    def _pose(self, q: FloatArray) -> FloatArray:
        out = np.empty((len(q), self.problem.task.size))
        pose_rows(self.problem.model.chain, self.problem.task.kind, q, out)
        return out


@kernel
def pose_rows(chain, kind, q, out):
    """Task coordinates of a chain, row by row: ``q`` (B, n), ``out`` (B, m)."""
    rotation, position = np.empty((3, 3)), np.empty(3)
    for row in range(q.shape[0]):
        forward(chain, q[row], rotation, position)
        task_kernels.coordinates(kind, rotation, position, out[row])
