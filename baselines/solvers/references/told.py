"""Any policy with the plant of its episode, which is privileged information: the value of knowing it."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from baselines import registry
from baselines.policy import Batch, Memory, Problem, Solution
from baselines.wrapper import NamedWrapper
from ikgym.exceptions import InvalidInputError
from ikgym.scenarios import Preview, Scenario
from ikgym.scenarios.preview import furthest
from ikgym.validation import LARGEST, FloatArray, whole_number

if TYPE_CHECKING:
    from ikgym.plant import DrawnPlant

#: The policy that makes up for drives whose delay and lag are known.
PREDICTED = "predicted"


@dataclasses.dataclass(frozen=True, eq=False)
class Told(NamedWrapper):
    """Hands another policy the arm that moves as its model, and the delay and the lag of its drives.

    A reference, not a contender: no observation shows the plant. It is no bound either, since the policy that is told
    is as good as it is, sees the measurements, and learns of a payload when it is taken up. Where drives are late the
    policy is wrapped in ``predicted``, with their delay and bandwidth.

    Args:
        problem: The scenario as the policy knows it.
        policy: The name of the policy that knows it.
        options: Its parameters; those left out have its defaults.
        seed: Which episode is played; needed where anything is drawn.
        arm_seed: Which arm moves; that of the seed if left out.
        scenario: The tracking problem.

    Raises:
        UnknownNameError: There is no such policy, or parameter of it.
        InvalidInputError: There is no seed where one is needed, a seed is no whole number of at least 0, the policy is
            a reference itself, or the drives have more than delays and lags.
    """

    policy: str = "rhc_foresight"
    seed: int | None = None
    arm_seed: int | None = None
    scenario: Scenario = dataclasses.field(kw_only=True)
    drawn: DrawnPlant = dataclasses.field(init=False, repr=False)

    name: ClassVar[str] = "told"
    reference: ClassVar[bool] = True

    def __post_init__(self) -> None:
        scenario = self.scenario
        if more := [name for name in ("drive", "gain", "resonance") if name in scenario.plant.switched_on()]:
            raise InvalidInputError(
                f"plant: expected drives with delays and lags alone, which is all that a policy can be told, got "
                f"{', '.join(more)}."
            )
        for name in ("seed", "arm_seed"):
            if (value := getattr(self, name)) is not None:
                object.__setattr__(self, name, whole_number(name, value, at_least=0))
        if self.seed is None and scenario.varies:
            raise InvalidInputError(f"Scenario {scenario.name!r} is random: a seed says which episode is meant.")
        object.__setattr__(self, "drawn", scenario.drawn_plant(self.seed or 0, self.arm_seed))
        super().__post_init__()
        delay, bandwidth = self.drawn.command_delay, self.drawn.bandwidth
        if np.any(delay) or np.min(bandwidth) < math.inf:
            lag = tuple(np.minimum(bandwidth, LARGEST)) if np.ndim(bandwidth) else bandwidth
            known = {"delay": delay, "bandwidth": None if lag == math.inf else lag, "identify": False}
            kind = registry.get(PREDICTED)
            driven = kind(self.inner_problem(), policy=self.policy, options=self.options, **known)  # type: ignore[call-arg]
            object.__setattr__(self, "inner", driven)

    @classmethod
    def for_scenario(cls, scenario: Scenario, **parameters: Any) -> Self:
        """See :meth:`SolverPolicy.for_scenario`; unlike others this policy is handed the scenario itself."""
        return cls(Problem.of(scenario), scenario=scenario, **parameters)

    @property
    def preview(self) -> Preview:
        """That of the policy, and the longest delay of all episodes on top, so that each is shown the same."""
        longest = self.scenario.plant.longest_command_delay
        base = registry.get(self.policy)(self.inner_problem(), **self.options).preview
        return furthest(base) + longest if longest else self.inner.preview

    def inner_problem(self) -> Problem:
        """The problem of the scenario, with the true arm as the model."""
        return self.problem.replace(model=self.drawn.arm)

    def solve(self, batch: Batch, memory: Memory) -> Solution:
        """See :meth:`SolverPolicy.solve`."""
        outer, inside = self.split(memory)
        # A payload is equivalent to other joint coordinates: the model remains right.
        q, nominal = batch.q + self._payload(batch), batch.nominal
        if isinstance(self.inner.preview, int):
            nominal = np.ascontiguousarray(nominal[:, : self.inner.preview])
        step = self.ask(batch._replace(q=q, nominal=nominal), inside)
        return self.solution(step.qdot, outer, step)

    def _payload(self, batch: Batch) -> FloatArray:
        """Offset of the joint zeros by the payload at the end of the step, in [rad] or [m]. Shape (B, n)."""
        plant = self.scenario.plant
        after = self.scenario.steps - batch.remaining + 1.0
        return np.where(after >= plant.payload_step, np.broadcast_to(self.drawn.payload, batch.q.shape[1]), 0.0)
