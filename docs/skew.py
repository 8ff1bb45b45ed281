"""Measures what skew coordinates leave open: ``python -m docs.skew recovery right_paths``.

The cost of skew coordinates is the same for a rotation by θ and by 180° − θ. `recovery` counts the episodes in which
``rhc_foresight`` ends on the right orientation after a displacement of each joint by 0.5 rad. `right_paths` compares
the cheapest path of an episode with the cheapest one of the right orientation; it continues where it was killed. The
tables are written to `docs/results`.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from typing import Any, Literal

import gymnasium as gym
import numpy as np
import tyro
from tqdm import tqdm

import baselines
import ikgym
from baselines.evaluation.records import to_csv
from baselines.files import write
from baselines.oracle.search import polish
from baselines.oracle.several import path
from docs.measure import RESULTS, WORK
from ikgym.kernels.rotations import geodesic_angle

SKEW, WHOLE = "varga7-random", "varga7-pose-random"
HORIZON = "full_orientation:policy=rhc,options={'horizon':400,'iterations':1,'move_blocks':30}"
#: Displacement in [rad] or [m], and errors within which an arm has recovered, in [m] and [rad].
DISPLACED, NEAR, RIGHT = 0.5, 0.01, 0.3
#: Largest orientation error of a right path in [rad].
ALONG = 0.1
#: Test episodes: the test set, those beyond it with best known costs, and those beyond.
SET, KNOWN, BEYOND = range(64), range(64, 256), range(256, 448)


def recovery() -> list[dict[str, Any]]:
    """Episodes in which a displaced arm ends near the reference position, in the right orientation."""
    lines = []
    for scenario, places, number in ((SKEW, SET, 0), (SKEW, KNOWN, 1), (WHOLE, SET, 0)):
        for seed in range(3):
            line = {"scenario": scenario, "first": places.start, "episodes": len(places), "seed": seed}
            lines.append(line | {"recovered": _recovered(scenario, seeds(places), number, seed)})
    return lines


def _recovered(scenario: str, episodes: Sequence[int], number: int, seed: int) -> int:
    policy: Any = baselines.make("rhc_foresight", scenario, seed=seed)
    n, steps = ikgym.scenarios.get(scenario).joints, ikgym.scenarios.get(scenario).steps
    signs = np.random.default_rng(number).choice([-1.0, 1.0], size=(len(episodes), n))
    envs: Any = gym.make_vec("RedundantIK-v0", num_envs=len(episodes), scenario=scenario, preview=policy.preview)
    start = envs.reset(seed=list(episodes))[0]["q"]
    observation, _ = envs.reset(seed=list(episodes), options={"q": start + DISPLACED * signs})
    state = info = None
    for _ in range(steps - 1):
        action, state = policy.predict(observation, state)
        observation, *_, info = envs.step(action)
    envs.close()
    return int(((info["position_error"] < NEAR) & (info["orientation_error"] < RIGHT)).sum())


def right_paths() -> list[dict[str, Any]]:
    """Episodes whose cheapest path has a wrong orientation, and the costs of right ones over those of the cheapest.

    Paths of policies, and the cheapest path on whole poses, are improved to local minima of the cost.
    """
    kept = WORK / "right_paths.jsonl"
    kept.parent.mkdir(parents=True, exist_ok=True)
    lines = list(map(json.loads, kept.read_text(encoding="utf-8").splitlines())) if kept.exists() else []
    todo = seeds(range(KNOWN.start, BEYOND.stop))[len(lines) :]
    with kept.open("a", encoding="utf-8") as file:
        for seed in tqdm(todo, file=sys.stderr, unit="episode"):
            lines.append(_right_path(seed))
            file.write(json.dumps(lines[-1]) + "\n")
            file.flush()
    kept.unlink()
    return [line for line in lines if line["angle"] > ALONG]


def _right_path(seed: int) -> dict[str, Any]:
    skew, whole = ikgym.scenarios.get(SKEW), ikgym.scenarios.get(WHOLE)
    paths = {name: path(skew, seed, name) for name in ("rhc_foresight", HORIZON)}
    paths["whole pose"] = polish(whole, seed, {"a": path(whole, seed, "rhc_foresight"), "b": paths[HORIZON]}).q
    found = [polish(skew, seed, {name: q}) for name, q in paths.items()]
    angles = [_angle(whole, seed, one.q) for one in found]
    best = min(range(len(found)), key=lambda i: found[i].cost)
    right = [one.cost / found[best].cost for one, angle in zip(found, angles, strict=True) if angle <= ALONG]
    return {"seed": seed, "angle": angles[best], "times_cheapest": min(right, default=None)}


def _angle(whole: ikgym.Scenario, seed: int, q: Any) -> float:
    """The largest orientation error of a path in [rad]."""
    rotations, _ = whole.arm.forward(q)
    wanted = whole.nominal(seed)[1:, :9].reshape(-1, 3, 3)
    return max(geodesic_angle(one, other) for one, other in zip(rotations, wanted, strict=True))


def seeds(places: range) -> tuple[int, ...]:
    """Reset seeds of test episodes."""
    return ikgym.scenarios.seeds("test", places.stop)[places.start :]


def main(tables: tyro.conf.Positional[tuple[Literal["recovery", "right_paths"], ...]]) -> None:
    """Writes the tables."""
    for name in tables:
        lines = recovery() if name == "recovery" else right_paths()
        write(RESULTS / f"{name}.csv", to_csv(lines).encode())


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
