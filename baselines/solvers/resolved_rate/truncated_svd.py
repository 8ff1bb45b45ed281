"""Resolved rate by the truncated singular value decomposition."""

from __future__ import annotations

import dataclasses
from typing import Annotated, ClassVar

from baselines.solvers.resolved_rate.moore_penrose import Pseudoinverse
from ikgym.validation import Bounds


@dataclasses.dataclass(frozen=True, eq=False)
class TruncatedSVD(Pseudoinverse):
    """The pseudoinverse without the small singular values: Δq = Σ v uᵀ Δx / σ over the large σ (Khan 2020, section 2).

    The joint shift is at most ‖Δx‖ / (threshold σ_max). Within the directions that are kept nothing is distorted,
    unlike with damping; those left out are not tracked at all until their singular value has grown again, when the
    accumulated error is corrected at once: the joint velocity jumps. Wherever one is left out the status says
    ``rank_deficient``.

    Args:
        problem: The scenario as the policy knows it.
        gain: Fraction of the error corrected per step; see :class:`ResolvedRate`.
        threshold: Singular values of the task Jacobian below this share of the largest are left out. Between 0
            and 1.

    Raises:
        InvalidInputError: The gain or the threshold is out of its range.
    """

    threshold: Annotated[float, Bounds(at_least=0.0, below=1.0)] = 3e-3

    name: ClassVar[str] = "truncated_svd"

    def __post_init__(self) -> None:
        super().__post_init__()
        self._settle(tolerance=self.threshold)
