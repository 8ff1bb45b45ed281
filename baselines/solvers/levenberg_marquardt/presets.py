"""The controllers of the two examples of Zhang 2020, with the numbers printed there."""

from __future__ import annotations

import dataclasses
from typing import ClassVar

from baselines.solvers.levenberg_marquardt.mfac import ModelFreeAdaptiveControl
from baselines.solvers.levenberg_marquardt.mfapc import ModelFreeAdaptivePredictiveControl


@dataclasses.dataclass(frozen=True, eq=False)
class HelixAdaptiveControl(ModelFreeAdaptiveControl):
    """A preset of `mfac` for `zhang3-helix`: the controller (5) under the rule of (44), example 1 without prediction.

    λ begins at 2 m² and the threshold for the error is 10 m, as printed for links of 5 to 7 m.
    """

    rule: str = "threshold"
    damping: float | None = 2.0
    growth: float | None = 1.1
    decay: float | None = 1.02
    threshold: float | None = 10.0
    carry: bool | None = True
    one_step: bool = True

    name: ClassVar[str] = "mfac_helix"
    example: ClassVar[bool] = True


@dataclasses.dataclass(frozen=True, eq=False)
class HelixPredictiveControl(ModelFreeAdaptivePredictiveControl):
    """A preset of `mfapc` for `zhang3-helix`: the controller (27), (28), (44) of example 1, n = 5 and J constant.

    λ begins at 2 m² and the threshold for the error of all five points is 10 m, as printed for links of 5 to 7 m.
    """

    rule: str = "threshold"
    damping: float | None = 2.0
    growth: float | None = 1.1
    decay: float | None = 1.02
    threshold: float | None = 10.0
    carry: bool | None = True
    one_step: bool = True
    horizon: int = 5
    jacobians: str = "constant"

    name: ClassVar[str] = "mfapc_helix"
    example: ClassVar[bool] = True


@dataclasses.dataclass(frozen=True, eq=False)
class LinePredictiveControl(ModelFreeAdaptivePredictiveControl):
    """A preset of `mfapc` for `zhang6-lspb`: the iteration (55)-(59) of example 2, n = 2, λ = 0, 10 iterations."""

    rule: str = "constant"
    damping: float | None = 0.0
    iterations: int = 10
    horizon: int = 2

    name: ClassVar[str] = "mfapc_line"
    example: ClassVar[bool] = True
