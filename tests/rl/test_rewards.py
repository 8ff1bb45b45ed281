"""Returns agree with scores over policies of all qualities, and no trick pays."""

from __future__ import annotations

import functools

import numpy as np
import pytest
from scipy.stats import spearmanr

import baselines
from baselines.episodes import begin
from baselines.registry import parse_policy
from benchmarks.yardsticks import episode_rewards
from ikgym import rl, scenarios
from ikgym.kernels.outcome import observation
from ikgym.rl.scoring import yardsticks

#: The better one of tuned `dls` and `qp`.
SOLVERS = {"Fast": "dls:gain=0.06", "Limits": "qp:gain=1.0", "Camera": "dls:gain=0.03", "Payload": "dls:gain=0.55"}
STILL = None

every_id = pytest.mark.parametrize("name", rl.IDS)
one_id_at_least = pytest.mark.parametrize(
    "name", [name if "Track" in name else pytest.param(name, marks=pytest.mark.slow) for name in rl.IDS]
)


def tuned(name):
    return SOLVERS.get(name.removeprefix("ikgym/").removesuffix("-v0"), "dls:gain=1.0")


def changed(action, kind, size, step, q, distance, rng):
    """Actions of a policy of another quality. Shape (N, n)."""
    steps, share = step
    match kind:
        case "stop":  # for some of 50 steps
            return action * (steps % 50 >= size)
        case "hold":
            return action * (share < size)
        case "late":
            return action * (share >= size)
        case "early":  # gets lost on purpose
            return action if share < size else np.ones_like(action)
        case "flee":
            return np.where(distance[:, None] > size, 1.0, 0.0) * np.ones_like(action)
        case "slow":
            return action * size
        case "jitter":
            return action + size * (-1) ** steps
        case "white":
            return action + size * rng.normal(size=action.shape)
        case "bias":
            return action + size * np.cos(np.arange(7))
        case "wavy":  # as a network errs
            return action + size * np.sin(4.0 * q + np.arange(7))
    raise ValueError(kind)


@functools.cache
def play(name, policy, change=None, split="validation", episodes=16):
    """Mean return and score of a policy whose actions are changed."""
    task, (costs, present) = rl.IDS[name].task, record(name, policy, change, split, episodes)
    found, returns = yardsticks(name, split, episodes), (episode_rewards(task, costs) * present).sum(axis=0).mean()
    log_cost = np.log1p(costs[-(task.counted or 0) :].sum(axis=0)).mean()
    return returns, (found["still"] - log_cost) / (found["still"] - found["solver"])


def record(name, policy, change, split, episodes):
    """Costs of the steps, and whether the episode would have gone on until then. Shapes (steps, N)."""
    task, rng = rl.IDS[name].task, np.random.default_rng(0)
    scenario, seeds = scenarios.get(task.scenario), scenarios.seeds(split, episodes)
    kind, parameters = parse_policy(policy or "dls")
    solver = baselines.make(kind, scenario, **parameters)
    arms, out = begin(scenario, seeds, preview=solver.preview, commands=solver.commands)
    most = task.share * scenario.largest_qdot / scenario.velocity_limit
    state, lost, distance, costs, present = None, np.zeros(episodes, np.bool_), np.zeros(episodes), [], []
    for step in range(scenario.steps):
        seen = observation(out)
        action, state = solver.predict(seen, state)
        action = np.clip(action / most, -1.0, 1.0) if policy else np.zeros_like(action)
        if change:
            action = changed(action, *change, (step, step / scenario.steps), seen["q"], distance, rng)
        out = arms.step(np.clip(action, -1.0, 1.0) * most)
        distance = out.position_error.copy()
        costs.append(out.cost.copy())
        present.append(~lost)
        lost = lost | (distance > (task.lost_distance or np.inf))
    return np.array(costs), np.array(present)


def policies(name):
    """Some fifty, from the best to those that flee."""
    best = tuned(name)
    dls = best.replace("qp", "dls")
    out = [(f"dls:gain={gain}", None) for gain in (0.02, 0.05, 0.1, 0.3, 0.7)]
    out += [(f"{dls},damping={damping}", None) for damping in (0.01, 0.03, 0.05, 0.1, 0.2, 0.4, 1.0)]
    out += [(f"dls:gain={gain},damping=0.05", None) for gain in (0.03, 0.08, 0.2)]
    sizes = {"stop": (3, 8, 25), "hold": (0.5, 0.8), "late": (0.1,), "early": (0.5, 0.9), "slow": (0.5, 0.8)}
    sizes |= {"jitter": (0.02, 0.1, 0.5), "white": (0.01, 0.03, 0.1, 0.3), "bias": (0.02, 0.1)}
    sizes["wavy"] = (0.01, 0.03, 0.1, 0.3)
    out += [(best, (kind, size)) for kind, many in sizes.items() for size in many]
    out += [("dls:gain=0.1", ("wavy", size)) for size in (0.01, 0.03, 0.1)]
    out += [(STILL, change) for change in (None, ("flee", 0.03), ("flee", 0.09), ("white", 0.1), ("white", 1.0))]
    out += [("qp", None), (dls, None)] + [("agent_track", change) for change in (None, ("white", 0.05), ("stop", 8))]
    if not scenarios.get(rl.IDS[name].task.scenario).plant.ideal:
        out += [(f"{kind}:policy=dls", None) for kind in ("offset_free", "calibrated", "filter_bank")]
    return out


@one_id_at_least
@pytest.mark.parametrize("split", ["validation", "test"])
def test_returns_rank_policies_as_scores_do(name, split):
    found = np.array([play(name, *policy, split) for policy in policies(name)])
    assert len(found) >= 30
    assert spearmanr(*found.round(3).T).statistic >= 0.97


@every_id
@pytest.mark.parametrize("trick", [("stop", 8), ("jitter", 0.1), ("early", 0.5), ("late", 0.1), ("hold", 0.8)], ids=str)
def test_tricks_do_not_pay(name, trick):
    (honest, score), (cheat, other) = play(name, tuned(name)), play(name, tuned(name), trick)
    assert cheat <= honest * (1.0 + 1e-8)
    assert cheat < honest or other > score - 1e-3  # an arm at a still target may rest


@every_id
def test_fleeing_returns_less_than_standing_still(name):
    still, soon, late = (play(name, STILL, change)[0] for change in (None, ("flee", 0.03), ("flee", 0.09)))
    assert soon < still
    assert late < 1.05 * still  # there it is lost within a centimetre anyway
