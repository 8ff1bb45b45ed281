"""What the network of a learner can represent: it imitates the policy with score 1, in states that it visits itself."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import torch
from gymnasium.vector import AutoresetMode

import baselines
import ikgym.sb3
from baselines.registry import parse_policy
from baselines.training import rewards
from ikgym import rl
from ikgym.rl.envs import LearningVectorEnv
from ikgym.rl.scoring import FILE
from ikgym.vector_env import RedundantIKVectorEnv


def imitate(name: str, settings: dict[str, Any], seed: int) -> Any:
    """An actor of SAC trained by regression: as many steps, updates and samples as SAC has with the same settings.

    In each step the network moves N arms, the solver says what it would do in their states, and a batch of all states
    so far makes one update towards it (DAgger, Ross, Gordon and Bagnell 2011).
    """
    torch.set_num_threads(1)
    task, rows, rng = rl.IDS[name].task, settings["n_envs"], np.random.default_rng(seed)
    model: Any = rewards.make("sac", ikgym.sb3.make_vec(name, rows), settings, seed)
    envs = LearningVectorEnv(rows, task, autoreset_mode=AutoresetMode.SAME_STEP)
    kind, parameters = parse_policy(json.loads(FILE.read_text(encoding="utf-8"))["policies"][name])
    solver = baselines.make(kind, envs.scenario, **parameters)
    twin = RedundantIKVectorEnv(  # the same arms, as the solver sees them
        rows, envs.scenario, solver.preview, AutoresetMode.SAME_STEP, None, None, solver.commands, task.lost_distance
    )
    most = task.share * envs.scenario.largest_qdot / envs.scenario.velocity_limit
    (shown, _), (seen, _) = envs.reset(seed=seed), twin.reset(seed=seed)
    steps = settings["n_timesteps"] // rows
    states = np.zeros((steps, *shown.shape), np.float32)
    answers = np.zeros((steps, rows, envs.scenario.joints), np.float32)
    memory, begun = None, np.ones(rows, dtype=np.bool_)
    for step in range(steps):
        wanted, memory = solver.predict(seen, memory, begun)
        states[step], answers[step] = shown, np.clip(wanted / most, -1.0, 1.0)
        action = model.predict(shown, deterministic=True)[0]
        shown, _, lost, over, _ = envs.step(action)
        seen, *_ = twin.step(np.clip(action.astype(np.float64), -1.0, 1.0) * most)
        begun = lost | over
        drawn = rng.integers(step + 1, size=model.batch_size), rng.integers(rows, size=model.batch_size)
        model.actor.optimizer.param_groups[0]["lr"] = model.lr_schedule(1.0 - step / steps)
        found = model.actor(torch.as_tensor(states[drawn]), deterministic=True)
        loss: Any = torch.nn.functional.mse_loss(found, torch.as_tensor(answers[drawn]))
        model.actor.optimizer.zero_grad()
        loss.backward()
        model.actor.optimizer.step()
    return model
