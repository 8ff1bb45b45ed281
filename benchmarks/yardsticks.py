"""Costs that scores of agents are measured by: ``python -m benchmarks.yardsticks``, in about half an hour.

For each environment by id and each of the episodes that agents are scored on: the cost of an arm at rest; that of the
best policy without learning among those of :func:`candidates`, which see what a learner sees; and the best known cost.
Settings are those with the least cost on the first episodes of the split `validation`, the scores of all of them are in
``docs/results/yardsticks.csv``. A best known cost is the least of this and former measurements; ``--informed`` also
plays policies with foresight that know the deviations of the plant and have exact sensors without delay.
"""

from __future__ import annotations

import dataclasses
import itertools
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np

import baselines
from baselines.episodes import Episode, rollout, rollouts
from baselines.evaluation.table import to_csv
from baselines.files import write
from baselines.policy import Batch, Memory, Solution, SolverPolicy, statuses
from baselines.registry import parse_policy
from ikgym import rl, scenarios
from ikgym.rl.scoring import EPISODES, FILE, play
from ikgym.rl.track import cost_rewards
from ikgym.scenarios import Preview, Scenario
from ikgym.validation import Bounds, FloatArray

TABLE = Path(__file__).parents[1] / "docs/results/yardsticks.csv"
#: The import path of :class:`Proportional`.
LAW = "benchmarks.yardsticks:Proportional"
#: Score at the reward threshold, and noise of the drives in [rad/s] that takes a solver there.
SOLVED, NOISES = 0.8, (0.0, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0)
#: Episodes on which settings are tried.
TRIED = 32
#: Policies one of which has the best cost of an episode, with ``--informed``.
INFORMED = ("dls", "rhc_foresight", "rhc:horizon=8")


@dataclasses.dataclass(frozen=True, eq=False)
class Proportional(SolverPolicy):
    """The law of README with a gain and look-ahead: q̇ = K J⁺ (X^N(k + a) − x(k)) / Δt.

    Args:
        problem: The scenario as the policy knows it.
        gain: K, the fraction of the error that is corrected in a step.
        ahead: a, the steps ahead of the reference that is followed.
    """

    gain: Annotated[float, Bounds(above=0.0)] = 1.0
    ahead: Annotated[int, Bounds(at_least=1)] = 1

    name: ClassVar[str] = "proportional"

    @property
    def preview(self) -> Preview:
        """See :attr:`SolverPolicy.preview`."""
        return (self.ahead,)

    def solve(self, batch: Batch, memory: Memory) -> Solution:
        """See :meth:`SolverPolicy.solve`."""
        arm, task, rows = self.problem.model, self.problem.task, len(batch.q)
        jacobian = task.jacobian(arm.forward(batch.q)[0], arm.jacobian(batch.q))
        shift = self.gain * task.error(batch.nominal[:, 0], batch.pose)
        qdot = (np.linalg.pinv(jacobian, rcond=1e-2) @ shift[..., None])[..., 0] / self.problem.dt
        return Solution(qdot, memory, statuses(rows), np.zeros(rows, dtype=np.int64))


def candidates(scenario: Scenario) -> dict[str, list[str]]:
    """Policies without learning, and the settings that are tried.

    They see 5 steps of the reference ahead at most, as learners do. The last four are left out where the plant is
    ideal: they are their base policy there.
    """
    out = {
        "dls": _grid("dls", gain=(0.03, 0.06, 0.1, 0.2, 0.3, 0.55, 1.0), damping=(1e-3, 1e-2, 0.03)),
        "proportional": _grid(LAW, gain=(0.09, 0.12, 0.16, 0.2, 0.3, 0.5, 0.75, 1.0), ahead=(1, 3, 5)),
        "qp": _grid("qp", gain=(0.06, 0.2, 0.5, 1.0)),
        "rhc": _grid("rhc", horizon=(5,), terminal_weight=(1, 30)),
    }
    if not scenario.plant.ideal:
        base: dict[str, Any] = {"policy": ("dls",), "options": ({"gain": 0.3},)}
        prior: dict[str, Any] = {"zero": (0.01,), "link": (2e-3,), "axis": (5e-3,)}
        direct: dict[str, Any] = {"delay": (0,), "bandwidth": (None,), "identify": (False,)}
        noises = ({"pose_noise": (a,), "pose_rotation_noise": (2 * a,)} for a in (3e-4, 1e-3))
        out |= {
            "predicted": _grid("predicted", **base, **direct, gain=(0.1, 0.15, 0.2, 0.3, 0.5)),
            "offset_free": _grid("offset_free", **base, gain=(0.1, 0.2, 0.4, 0.7, 1.0)),
            "calibrated": [
                spec for one in noises for spec in _grid("calibrated", **base, **prior, **one, jump=(1e-3, 0.02))
            ],
            "filter_bank": _grid("filter_bank", **base, **prior, blend=(1e-3, 3e-3, 0.01)),
        }
    return out


def _grid(name: str, **values: Sequence[Any]) -> list[str]:
    """A policy with all combinations of values."""
    texts = [[f"{key}={value}" for value in column] for key, column in values.items()]
    return [f"{name}:{','.join(row)}" for row in itertools.product(*texts)]


class Still:
    """An arm at rest."""

    def predict(self, observation: FloatArray, state: Any = None, **_: Any) -> tuple[FloatArray, Any]:
        """No motion."""
        return np.zeros((len(observation), 7)), state


def counted(name: str, policy: str, split: str, episodes: int = EPISODES, *, informed: bool = False) -> FloatArray:
    """Logarithms of 1 + cost of the first episodes of a split in an environment. Shape (episodes,).

    With `informed` the policy knows the deviations of the plant, whose sensors are exact.
    """
    task = rl.IDS[name].task
    scenario, seeds = scenarios.find(task.scenario), scenarios.seeds(split, episodes)
    kind, parameters = parse_policy(policy)
    if informed and not scenario.plant.ideal:
        exact = {"pose_noise": 0.0, "pose_rotation_noise": 0.0, "pose_every": 1, "pose_delay": 0, "pose_missing": 0.0}
        scenario = scenario.replace(plant=scenario.plant.replace(**exact))
        known = {"policy": kind, "options": parameters}
        played = [
            rollout(scenario, baselines.make("told", scenario, seed=seed, **known), seed, timed=False) for seed in seeds
        ]
    else:
        played = rollouts(scenario, baselines.make(kind, scenario, **parameters), seeds)
    return logarithms(played, task.counted)


def logarithms(episodes: Sequence[Episode], steps: int | None) -> FloatArray:
    """Logarithms of 1 + cost of the last steps of episodes, None for all of them. Shape (episodes,)."""
    return np.log1p([one.cost[-(steps or 0) :].sum() for one in episodes])


def episode_rewards(task: rl.Task, cost: FloatArray, start: float | FloatArray = np.inf) -> FloatArray:
    """Rewards of whole episodes with the stage costs of all steps, `start` being that before. Shapes (steps, ...)."""
    closeness = cost_rewards(task, cost)
    before = np.broadcast_to(cost_rewards(task, np.asarray(start)), closeness[:1].shape)
    rewards: FloatArray = task.progress * np.diff(closeness, axis=0, prepend=before)
    counted = slice(-(task.counted or 0), None)
    rewards[counted] += closeness[counted]
    return rewards


def returns(task: rl.Task, episodes: Sequence[Episode]) -> FloatArray:
    """Sums of the rewards of whole episodes, see :class:`ikgym.rl.Task`. Shape (episodes,)."""
    rest = next(play(Still(), task, [one.seeds.seed for one in episodes]))  # an arm at rest is where it started
    start = rest["tracking_cost"] + rest["velocity_cost"]
    return np.array([episode_rewards(task, one.cost, at).sum() for one, at in zip(episodes, start, strict=True)])


def threshold(name: str, solver: str, still: FloatArray, one: FloatArray) -> float:
    """The mean return of a solver where noise of the drives takes its score down to 0.8."""
    task, points = rl.IDS[name].task, []
    scenario, (kind, parameters) = scenarios.find(task.scenario), parse_policy(solver)
    policy, seeds = baselines.make(kind, scenario, **parameters), scenarios.seeds("validation", TRIED)
    for noise in NOISES:
        played = rollouts(scenario.replace(plant=scenario.plant.replace(noise=noise)), policy, seeds)
        gap = still[:TRIED].mean() - logarithms(played, task.counted).mean()
        points.append((gap / (still[:TRIED].mean() - one[:TRIED].mean()), returns(task, played).mean()))
    scores, means = np.array(sorted(points)).T
    return round(float(np.interp(SOLVED, scores, means)), 3)


def measure(name: str, specs: Sequence[str], split: str, best: Sequence[float]) -> dict[str, FloatArray]:
    """Logarithms of 1 + cost of an arm at rest, of policies, and the best known ones. Shapes (episodes,)."""
    still = np.log1p(np.asarray(rl.costs(Still(), name, split=split, episodes=EPISODES)))
    played = {spec: counted(name, spec, split) for spec in specs}
    known = [np.array(best), *played.values()]
    if "--informed" in sys.argv:
        known += [counted(name, spec, split, informed=True) for spec in INFORMED]
    return {"still": still, **played, "best": np.min(known, axis=0)}


def main() -> None:
    """Measures all of them and writes the files."""
    former, splits = json.loads(FILE.read_text(encoding="utf-8")), ("validation", "test")
    out: dict[str, Any] = {"policies": {}, "thresholds": {}, **{split: {} for split in splits}}
    lines = []
    for name, kind in rl.IDS.items():
        specs = {
            family: min(grid, key=lambda spec: float(counted(name, spec, "validation", TRIED).mean()))
            for family, grid in candidates(scenarios.find(kind.task.scenario)).items()
        }
        logs = {split: measure(name, [*specs.values()], split, former[split][name]["best"]) for split in splits}
        solver = min(specs.values(), key=lambda spec: float(logs["validation"][spec].mean()))
        out["policies"][name] = solver
        out["thresholds"][name] = threshold(name, solver, logs["validation"]["still"], logs["validation"][solver])
        for split, log in logs.items():
            yardsticks = {"still": log["still"], "solver": log[solver], "best": log["best"]}
            out[split][name] = {policy: values.round(4).tolist() for policy, values in yardsticks.items()}
        for family, spec in (*specs.items(), ("known", "best")):
            line = {"environment": name, "policy": family, "settings": spec * (family != "known")}
            for split, log in logs.items():
                still, log_cost, one = (log[policy].mean() for policy in ("still", spec, solver))
                line[split] = f"{(still - log_cost) / (still - one):.3f}"
            lines.append(line)
            print(*line.values(), flush=True)
    FILE.write_text(json.dumps(out).replace("}, ", "},\n").replace("], ", "],\n") + "\n", encoding="utf-8")
    write(TABLE, to_csv(lines).encode())


if __name__ == "__main__":
    main()
