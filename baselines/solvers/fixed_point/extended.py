"""The fixed-point transformation with one more point of the arm prescribed (Faitli and Tar 2018, conclusion)."""

from __future__ import annotations

import dataclasses
from typing import ClassVar

from baselines.policy.parameters import checked, parameter
from baselines.solvers.arm_size import jacobian_bound
from baselines.solvers.fixed_point.fixed_point import FixedPoint
from baselines.solvers.references.follow_nominal import PrivilegedPath
from ikgym.arms import Arm
from ikgym.exceptions import InvalidInputError
from ikgym.kernels.kinematics import Chain
from ikgym.validation import FloatArray, frozen_array, read_only, whole_number


@dataclasses.dataclass(frozen=True, eq=False)
class FixedPointExtended(PrivilegedPath, FixedPoint):
    """:class:`FixedPoint` with x extended by the end point of a link, which brings q back to the nominal joint path.

    A reference, not a solver to compare with: where that end point should be follows from the nominal joint path, which
    is privileged information (a tool position leaves the elbow up to four places). The paper has it, since it makes its
    trajectories in joint space. h becomes Jᵀ (f(q) - x) + J_ℓᵀ (p_ℓ(q) - p_ℓᴺ), with both points of the model.

    Args:
        problem: The scenario as the policy knows it.
        transformation: ``"transpose"``; nothing else fits a longer x.
        slope: The factor in F; see :class:`FixedPoint`, like all up to the tolerance.
        a: A; if left out, chosen for the longer Jacobian as there for J: -0.815 on the paper's arm, of whose A = -1
            the bound is not sure. With -1 it converges on its trajectories, too, and comes nearer.
        d: D.
        iterations: Iterations in one step.
        tolerance: Norm of both errors together after the last up to which the status is ``converged``.
        components: None, see :class:`FixedPoint`.
        length: ℓ, what 1 rad counts as, in [m]; the link's end point counts as the tool point does.
        seed: Which episode of a random scenario is played.
        link: ℓ, whose end point, the place of joint ℓ + 1, x is extended by. From 1 to n - 1; of use where that point
            moves, unlike the end of link 2 of ``varga7``.
        path: The nominal joint coordinates, one row a step, in [rad] or [m]. Shape (steps + 1, n).

    Raises:
        InvalidInputError: A parameter is out of its range, or the scenario has no joint path, or is random and there
            is no seed.
        UnknownNameError: There is no such transformation.
    """

    seed: int | None = None
    link: int = parameter(2, whole_number, at_least=1)
    path: FloatArray = dataclasses.field(kw_only=True)
    _branch: Arm = dataclasses.field(init=False, repr=False)
    _points: FloatArray = dataclasses.field(init=False, repr=False)

    name: ClassVar[str] = "fixed_point_extended"

    def __post_init__(self) -> None:
        if not isinstance(self.transformation, str) or self.transformation != "transpose":
            raise InvalidInputError(
                f"transformation: a longer x needs the transposed Jacobian, expected 'transpose', got "
                f"{self.transformation!r}."
            )
        model, link = self.problem.model, checked(self)["link"]
        if link >= model.joints:
            raise InvalidInputError(f"link: expected at most {model.joints - 1} for arm {model.name!r}, got {link}.")
        branch = Arm(
            f"{model.name} up to link {link}",
            model.offsets[:link],
            model.axes[:link],
            model.prismatic[:link],
            tool=model.offsets[link],
        )
        path = frozen_array("path", self.path, (None, model.joints))
        self._settle(path=path, _branch=branch, _points=read_only(branch.forward(path[:, :link])[1]))
        super().__post_init__()

    def _extension(self) -> tuple[Chain, FloatArray]:
        return self._branch.chain, self._points

    def _jacobian_bound(self) -> float:
        return super()._jacobian_bound() + jacobian_bound(self._branch, None)
