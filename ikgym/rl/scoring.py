"""Scores of agents in the environments by id: 0 is an arm at rest, 1 is the best known without learning."""

from __future__ import annotations

import functools
import json
import pathlib
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ikgym import scenarios
from ikgym.exceptions import InvalidInputError
from ikgym.rl.envs import LearningVectorEnv
from ikgym.rl.ids import IDS, TaskEnv
from ikgym.rl.task import Task
from ikgym.validation import FloatArray, float_array, known_name, known_names, shorten, whole_number

#: Logarithms of 1 + cost of the yardsticks by split and id, one number an episode; ``python -m benchmarks.yardsticks``
#: measures them, on the first episodes of each split.
EPISODES = 256
FILE = pathlib.Path(__file__).with_name("yardsticks.json")
#: Resamples of a bootstrap interval.
RESAMPLES = 2000


class Costs(np.ndarray[Any, np.dtype[np.float64]]):
    """Costs of episodes, one number each, and the split of their seeds."""

    split: str | None = None

    def __array_finalize__(self, source: Any) -> None:
        self.split = getattr(source, "split", None)


class Score(NamedTuple):
    """The score of an agent in one environment.

    Attributes:
        mean: Interquartile mean over the training seeds.
        low: Lower end of the 95 % bootstrap interval over the seeds.
        high: Its upper end.
        best: Score of the best known cost.
    """

    mean: float
    low: float
    high: float
    best: float


def costs(model: Any, name: str, *, split: str = "validation", episodes: int = 64, **changes: Any) -> Costs:
    """Plays whole episodes, also beyond where training would end them.

    Args:
        model: Any object with the `predict` of Stable-Baselines3.
        name: Of the environment, such as ``"ikgym/Track-v0"``.
        split: Seeds of the episodes, see :data:`ikgym.scenarios.SPLITS`.
        episodes: Their number.
        changes: Fields of :class:`ikgym.rl.Task` with which the model was trained, such as `inverse=True`. Scenario and
            counted steps are those of the id.

    Returns:
        The benchmark's costs: of the last 50 steps of ``"ikgym/Reach-v0"``, else of all. Shape (episodes,).

    Raises:
        UnknownNameError: There is no such environment or split.
        UnexpectedArgumentError: There is no such field.
        InvalidInputError: The split has fewer episodes, the model has no such `predict`, or its action is refused.
    """
    kind = environment(name)
    task = kind.change_task(changes)
    if (task.scenario, task.counted) != (kind.task.scenario, kind.task.counted):
        raise InvalidInputError(f"{name}: expected its scenario and counted steps, with which scores are defined.")
    seeds = scenarios.seeds(split, whole_number("episodes", episodes, at_least=1))
    if not callable(getattr(model, "predict", None)):
        raise InvalidInputError(f"model: expected an object with the method predict, got {shorten(model)}.")
    total = np.zeros(len(seeds))
    steps = list(play(model, task, seeds))
    for infos in steps[-(task.counted or 0) :]:
        total += infos["tracking_cost"] + infos["velocity_cost"]
    out = total.view(Costs)
    out.split = split
    return out


def play(model: Any, task: Task, seeds: Sequence[int]) -> Iterator[dict[str, Any]]:
    """The infos of each step of whole episodes, also beyond where training would end them; see :func:`costs`."""
    envs = LearningVectorEnv(len(seeds), task.replace(lost_distance=None), autoreset_mode="Disabled")
    observation, _ = envs.reset(seed=list(seeds))
    state, begun = None, np.ones(len(seeds), dtype=np.bool_)
    for _ in range(envs.scenario.steps):
        answer = model.predict(observation, state=state, episode_start=begun, deterministic=True)
        if not isinstance(answer, tuple) or len(answer) != 2:
            raise InvalidInputError(f"model: expected predict to return action and state, got {shorten(answer)}.")
        action, state = answer
        observation, *_, infos = envs.step(action)
        begun = np.zeros_like(begun)
        yield infos


def score(results: Mapping[str, Any], split: str = "validation") -> dict[str, Score]:
    """Scores of agents, linear in the logarithm of 1 + cost.

    >>> ikgym.rl.score({"ikgym/Track-v0": [ikgym.rl.costs(model, "ikgym/Track-v0") for model in models]})

    The yardsticks are measured on the episodes that are scored, the first ones of the split.

    Args:
        results: Costs of :func:`costs` by id, one row a training seed. Shape (seeds, episodes).
        split: Of their episodes.

    Raises:
        UnknownNameError: There is no such environment or split.
        InvalidInputError: Costs are not of that shape, not finite or below 0, of more than 256 episodes, or of another
            split.
    """
    if not isinstance(results, Mapping):
        raise InvalidInputError(f"results: expected costs by the id of their environment, got {shorten(results)}.")
    known_names("environment", results, IDS)
    known_name("split", split, [name for name in scenarios.SPLITS if name in _yardsticks()])
    return {name: _score(name, value, split) for name, value in results.items()}


def environment(name: str) -> type[TaskEnv]:
    """The class of an id."""
    known_name("environment", name, IDS)
    return IDS[name]


def yardsticks(name: str, split: str, episodes: int) -> dict[str, float]:
    """Mean logarithms of 1 + cost over the first episodes of a split: `still`, `solver` and `best`."""
    return {policy: float(np.mean(values[:episodes])) for policy, values in _yardsticks()[split][name].items()}


def interquartile_mean(values: FloatArray) -> FloatArray:
    """The mean without the lowest and the highest quarter of the last axis. Shapes (..., k), (...)."""
    cut = values.shape[-1] // 4
    kept: FloatArray = np.sort(values, axis=-1)[..., cut : values.shape[-1] - cut].mean(axis=-1)
    return kept


def _score(name: str, value: Any, split: str) -> Score:
    rows = value if isinstance(value, (list, tuple)) else [value]
    other = {row.split for row in rows if isinstance(row, Costs)} - {None, split}
    if other:
        raise InvalidInputError(f"{name}: expected costs of the split {split!r}, got some of {other.pop()!r}.")
    cost = float_array(name, value)
    if cost.ndim != 2 or 0 in cost.shape or (cost < 0.0).any():
        raise InvalidInputError(f"{name}: expected costs of at least 0 of shape (seeds, episodes), got {cost.shape}.")
    episodes = whole_number(f"{name}: episodes", cost.shape[1], at_least=1, at_most=EPISODES)
    yardstick = yardsticks(name, split, episodes)

    def to_score(logarithm: Any) -> Any:
        return (yardstick["still"] - logarithm) / (yardstick["still"] - yardstick["solver"])

    seeds = to_score(np.log1p(cost).mean(axis=1))
    drawn = np.random.default_rng(0).choice(seeds, (RESAMPLES, len(seeds)))
    low, high = np.quantile(interquartile_mean(drawn), [0.025, 0.975]).tolist()
    return Score(float(interquartile_mean(seeds)), low, high, to_score(yardstick["best"]))


@functools.cache
def _yardsticks() -> dict[str, Any]:
    content: dict[str, Any] = json.loads(FILE.read_text(encoding="utf-8"))
    return content
