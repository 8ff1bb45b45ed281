"""The command line of `train.py` and `ikgym train`."""

from __future__ import annotations

import contextlib
import dataclasses
import importlib.util
import itertools
import pathlib
import shlex
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Annotated, Any, Union

import tyro
from tqdm import tqdm

from baselines.cli import shell
from baselines.cli.parsing import Rule, if_random
from baselines.cli.parsing import parse as parse_options
from baselines.files import check_writable, locked
from baselines.training.options import APG, METHODS, Rewards, TrainingError, preset_names
from ikgym import rl, scenarios
from ikgym.exceptions import InvalidInputError
from ikgym.validation import known_name, whole_number

PROGRAM = "train.py"


@dataclasses.dataclass(frozen=True, kw_only=True)
class Runs:
    """Runs of one method with several seeds."""

    seeds: Annotated[tuple[int, ...], tyro.conf.arg(metavar="N …")] = (0,)
    """One run each, one after the other; the same command continues with those that have not ended."""
    out: Annotated[pathlib.Path, tyro.conf.arg(metavar="DIR")]
    """Folder of the runs; that with seed N has the folder seed-N in it."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class ByGradients(Runs):
    """A training by gradients."""

    config: Annotated[APG, tyro.conf.arg(name="")]
    preset: Annotated[str | None, tyro.conf.arg(metavar="NAME")] = None
    """Options of a preset, or of a file NAME.toml; those on the command line take precedence."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class ByRewards(Runs):
    """A training by rewards."""

    config: Annotated[Rewards, tyro.conf.arg(name="")]


RULES = (
    Rule(("--learning-rate-end",), lambda given: given.config.segments > 1, "in one segment"),
    Rule(
        ("--reset-distance",),
        lambda given: len(given.config.window) > 1,
        "with one --window, which is also the last: see --reset-distance-end",
    ),
    Rule(("--settings",), lambda given: not given.config.defaults, "with --defaults"),
    if_random("--validation-episodes", lambda given: given.config.scenario),
)


def manual() -> str:
    """The text of ``--help`` above the options."""
    prog, evaluate = _program(), shell.program("evaluate", "python -m baselines.evaluate")
    return f"""\
Trains agents: networks from observations to joint velocities. apg differentiates the cost through the arm in any
scenario; ppo, sac and td3 are those of Stable-Baselines3 and recurrent_ppo is that of sb3-contrib, unmodified, in an
environment by id. Each method has options: {prog} METHOD --help

{shell.listing("Methods", METHODS)}

{shell.listing("Environments by id", rl.IDS)}

{shell.listing("Presets of apg", preset_names())}

{shell.listing("Scenarios of apg", scenarios.names())}

Examples:
  {prog} apg --preset quick --out runs/apg
  {prog} apg --preset standard --seeds 0 1 2 --out runs/apg
  {prog} ppo --env ikgym/Track-v0 --minutes 10 --seeds 0 1 2 --out runs/track-ppo
  {prog} sac --env ikgym/Reach-v0 --total-timesteps 100000 --out runs/reach-sac

Files of a run by rewards, all but apg, in seed-N:
  model.zip          the model, for its library
  agent.safetensors  the agent, for: {evaluate} --policies agent:FILE; none with a history or an LSTM
  curve.csv          CPU seconds, steps, and score on validation episodes: 0 standing still, 1 the best tuned solver
  run.json           at the end: settings, seed and final score

Files of a run of apg, which may be killed at any time, and which the same command continues:
  run.json           command, seed, versions, a row for each segment, hash of the final weights
  events.out.…       the rows, for: tensorboard --logdir DIR
  checkpoint.pt      the state to continue from
  agent.safetensors  at the end, the agent, for: {evaluate} --policies agent:FILE

Agents are trained on the seeds of the split "train" and validated on those of "validation"; those of "test" are not
used. The cost ratio is stated where the best known costs of all validation episodes are known."""


def main(arguments: Sequence[str]) -> int:
    """The command line: words after the command; returns the exit code."""

    def work() -> int:
        command = parse(arguments)
        for name in ("torch", "stable_baselines3", "sb3_contrib", "tensorboard"):
            if importlib.util.find_spec(name) is None:
                raise ModuleNotFoundError(name=name)
        with shell.escaped_output():
            _train(command, shlex.join([*_program().split(), *arguments]))
        return 0

    return shell.run(work, lambda: "Stopped. The same command continues.")


def _program() -> str:
    return shell.program("train", f"python {PROGRAM}")


def parse(arguments: Sequence[str]) -> ByGradients | ByRewards:
    """The command in a command line; without any words they are ``--help``."""
    given = list(arguments) or ["--help"]
    method = given[0]
    if method not in ("-h", "--help"):
        known_name("method", method, METHODS)
        if method != "apg" and not {"-h", "--help", "--env"} & {word.partition("=")[0] for word in given}:
            raise InvalidInputError(f"{method} needs an environment: expected --env, one of {', '.join(rl.IDS)}.")
    preset = _value_of("--preset", given) if method == "apg" else None
    kinds = [_subcommand(name, preset) for name in METHODS]
    any_of_them: Any = Union[tuple(kinds)]  # noqa: UP007  # made at run time
    command: ByGradients | ByRewards = parse_options(
        any_of_them, given, prog=_program(), description=manual(), rules=RULES
    )
    if isinstance(command, ByRewards):
        return dataclasses.replace(command, config=command.config.replace(algorithm=method))
    return command


def _subcommand(method: str, preset: str | None) -> Any:
    """The command of a method; options of apg that are left out are those of the preset."""
    about = METHODS[method]
    if method == "apg":
        default: Any = ByGradients(config=APG.preset(preset), out=tyro.MISSING)
        return Annotated[ByGradients, tyro.conf.subcommand(method, default=default, description=about)]
    return Annotated[ByRewards, tyro.conf.subcommand(method, description=about)]


def _value_of(option: str, arguments: Sequence[str]) -> str | None:
    """The value of an option that is needed before the others can be read."""
    for argument, following in itertools.zip_longest(arguments, arguments[1:], fillvalue=""):
        name, equals, value = argument.partition("=")
        if name.replace("_", "-") == option:
            return value if equals else following
    return None


def _train(command: ByGradients | ByRewards, text: str) -> None:
    """Trains all seeds, or continues with those that have not ended."""
    from baselines.training import rewards, run  # import PyTorch, an extra

    runs = {seed: command.out / f"seed-{seed}" for seed in _checked_seeds(command.seeds)}
    with contextlib.ExitStack() as locks:  # all before the first training, which takes hours
        for folder in runs.values():
            locks.enter_context(locked(folder))
            check_writable(folder)
        for seed, folder in runs.items():
            if isinstance(command, ByRewards):
                there = rewards.read_finished(command.config, seed, folder)
                about = there or rewards.train(command.config, seed, folder)
                score = f"score {about['validation_score']:.3f} after {about['steps']} steps"
            else:
                there = run.read_finished(command.config, seed, folder)
                with _bar(seed, command.config.segments) as show:
                    about = there or run.train(command.config, seed, folder, command=text, on_segment=show)
                score = describe(about["kept"])
            print(f"seed {seed}: {score}{', already there' if there else ''}", flush=True)
    print(f"\nwritten to {command.out}")


@contextlib.contextmanager
def _bar(seed: int, segments: int) -> Iterator[Callable[[int, float | None], None]]:
    """A progress bar on a terminal: the function that moves it."""
    with tqdm(total=segments, desc=f"seed {seed}", disable=None, unit="segment", dynamic_ncols=True) as bar:

        def show(done: int, cost: float | None) -> None:
            if cost is not None:
                bar.set_description(f"seed {seed}: cost {cost:.4g}", refresh=False)
            bar.update(done - bar.n)

        yield show


def _checked_seeds(seeds: Sequence[int]) -> tuple[int, ...]:
    """The seeds without repetitions."""
    checked = tuple(dict.fromkeys(whole_number("seeds", seed, at_least=0) for seed in seeds))
    if not checked:
        raise TrainingError("seeds: expected at least one.")
    return checked


def describe(score: Mapping[str, float]) -> str:
    """The validation of an agent in words."""
    ratio = f"cost ratio {score['cost_ratio']:.4f}, " if "cost_ratio" in score else ""
    return f"{ratio}cost {score['cost']:.5g}, worst {score['worst']:.4g}, lost {score['lost']:.1%}"
