"""Episodes of a policy as a data set of Minari: ``ikgym dataset``."""

from __future__ import annotations

import contextlib
import pathlib
import shutil
import sys
from collections.abc import Iterator, Sequence
from typing import Any

import gymnasium as gym
import h5py  # noqa: F401  # Minari's message does not say which extra installs it
import minari
import numpy as np
from minari.data_collector import EpisodeBuffer
from minari.dataset.minari_dataset import parse_dataset_id
from minari.dataset.minari_storage import MinariStorage
from tqdm import tqdm

from baselines.episodes import add_up
from baselines.evaluation.jobs import Job, Options, plan
from baselines.evaluation.metrics import describe
from baselines.evaluation.policies import AnyPolicy
from baselines.files import ResultsError, locked
from baselines.fingerprints import fingerprint
from ikgym import scenarios
from ikgym.env import RedundantIKEnv
from ikgym.exceptions import InvalidInputError
from ikgym.scenarios import Preview, Scenario


def write(
    scenario: str | Scenario,
    policy: AnyPolicy,
    out: pathlib.Path,
    *,
    episodes: int,
    split: str = "train",
    preview: Preview | None = None,
    overwrite: bool = False,
    progress: bool = False,
) -> None:
    """Plays episodes and writes them as a data set; a folder with a data set in it has all of its episodes.

    Args:
        scenario: The scenario, as :func:`ikgym.scenarios.find` takes it.
        policy: The policy, as :func:`baselines.evaluate.evaluate` takes it.
        out: The folder. Minari knows the data set by its name, such as ``dls-v0``.
        episodes: Number of episodes, the first seeds of the split.
        split: The split, see :data:`ikgym.scenarios.SPLITS`.
        preview: Steps ahead that the policy is shown; the preview of the policy if left out.
        overwrite: Whether to replace the data set in the folder.
        progress: Whether to show a progress bar on stderr.

    Raises:
        UnknownNameError: There is no such scenario, policy, parameter or split.
        InvalidInputError: A value is out of range, the policy does not suit the scenario, its episodes do not differ or
            depend on each other, or Minari does not accept the name of the folder.
        ResultsError: The folder cannot be written, or holds a data set.
    """
    name, jobs = out.absolute().name, _jobs(scenario, policy, episodes, split, preview)
    try:
        parse_dataset_id(name)
    except (ValueError, TypeError):
        raise InvalidInputError(f"out: expected a name with a version, such as dls-v0; got {name!r}.") from None
    first, draft, data = jobs[0], out / ".draft", out / "data"
    with locked(out):
        if data.exists() and not overwrite:
            raise ResultsError(f"{data} already exists: replace it with --overwrite, or choose another folder.")
        shutil.rmtree(draft, ignore_errors=True)  # of a process that was killed
        env, costs = _environment(first), list[dict[str, float]]()
        spaces = {"observation_space": env.observation_space, "action_space": env.action_space}
        storage = MinariStorage.new(draft.absolute(), env_spec=env.spec, **spaces)

        def play() -> Iterator[EpisodeBuffer]:
            for job in tqdm(jobs, disable=not progress, file=sys.stderr, unit="episode", dynamic_ncols=True):
                episode = _episode(env, job)
                costs.append(_costs(episode))
                yield episode

        storage.update_episodes(play())
        storage.update_episode_metadata(costs)
        text = ",".join(f"{key}={value!r}" for key, value in first.parameters.items())
        storage.update_metadata(
            {
                "dataset_id": name,
                "minari_version": minari.__version__,
                "algorithm_name": f"{first.policy}:{text}".rstrip(":"),
                "description": f"{episodes} episodes of {first.policy} in {first.scenario.name}.",
                "ikgym": {
                    "scenario": first.scenario.name,
                    "fingerprint": first.fingerprint,
                    "policy": first.policy,
                    "parameters": dict(first.parameters),
                    "split": split,
                    "preview": list(first.preview) if isinstance(first.preview, Sequence) else first.preview,
                    "machine": describe(),
                },
            }
        )
        if env.spec is None:
            with contextlib.suppress(InvalidInputError):  # a trajectory of a user's class, which no file can hold
                first.scenario.save(out / "scenario.toml")
        shutil.rmtree(data, ignore_errors=True)
        draft.rename(data)


def _jobs(scenario: str | Scenario, policy: AnyPolicy, episodes: int, split: str, preview: Preview | None) -> list[Job]:
    if policy == "all" or scenario == "all":
        raise InvalidInputError("A data set is of one policy in one scenario, got all of them.")
    jobs, _ = plan(Options(scenarios=[scenario], policies=[policy], episodes=episodes, split=split, preview=preview))
    if len(jobs) < episodes or any(job.before for job in jobs):
        raise InvalidInputError(
            f"{jobs[0].scenario.name}: expected a scenario with {episodes} different and independent episodes."
        )
    return jobs


def _environment(job: Job) -> gym.Env[Any, Any]:
    options: dict[str, Any] = {"preview": job.preview, "commands": job.bind().commands}
    name = job.scenario.name
    if name in scenarios.names() and fingerprint(scenarios.get(name)) == job.fingerprint:
        return gym.make("ikgym:RedundantIK-v0", scenario=name, **options)  # Minari can make it again
    return RedundantIKEnv(job.scenario, **options)


def _episode(env: gym.Env[Any, Any], job: Job) -> EpisodeBuffer:
    """Plays an episode. Minari's collector would need jax."""
    policy, state, ended = job.bind(), None, False
    observations, infos = [env.reset(seed=job.seeds.seed)[0]], list[dict[str, Any]]()
    actions, rewards = list[Any](), list[float]()
    while not ended:
        action, state = policy.predict(observations[-1], state, np.array([not actions]))
        seen, reward, _, ended, info = env.step(action)
        observations.append(seen)
        actions.append(np.clip(action, -1.0, 1.0))  # as it was applied
        rewards.append(float(reward))
        infos.append(info)
    return EpisodeBuffer(
        seed=job.seeds.seed,
        observations={key: np.array([one[key] for one in observations]) for key in observations[0]},
        actions=np.array(actions),
        rewards=np.array(rewards),
        infos={key: np.array([one[key] for one in infos]) for key in infos[0]},
        terminations=np.zeros(len(actions), dtype=np.bool_),
        truncations=np.arange(len(actions)) == len(actions) - 1,
    )


def _costs(episode: EpisodeBuffer) -> dict[str, float]:
    infos: dict[str, Any] = episode.infos
    names = [name for name in ("tracking_cost", "velocity_cost", "proximity_cost") if name in infos]
    return {"total_cost": float(add_up(-episode.rewards)), **{name: float(add_up(infos[name])) for name in names}}
