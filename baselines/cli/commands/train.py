"""The command line of `train.py` and `ikgym train`."""

from __future__ import annotations

import contextlib
import dataclasses
import importlib.util
import itertools
import pathlib
import shlex
import sys
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Union

import tyro

from baselines.cli import shell
from baselines.cli.parsing import Rule, if_random
from baselines.cli.parsing import parse as parse_options
from baselines.files import check_writable, locked
from baselines.training.options import APG, METHODS, Rewards, TrainingError, preset_names
from baselines.workers import Workers
from ikgym import rl, scenarios
from ikgym.exceptions import InvalidInputError
from ikgym.frozen import Frozen
from ikgym.validation import Bounds, known_name, whole_number

PROGRAM = "train.py"


@dataclasses.dataclass(frozen=True, kw_only=True)
class Options(Frozen):
    """Options of runs that do not change their results."""

    seeds: Annotated[tuple[int, ...], tyro.conf.arg(metavar="N …")] = (0,)
    """One run each."""
    out: Annotated[pathlib.Path, tyro.conf.arg(metavar="DIR")]
    """Folder for the files; the run with seed N has the folder seed-N in it."""
    resume: bool = False
    """Continue the runs in the folder; they end with the same weights as without the interruption."""
    overwrite: bool = False
    """Replace the runs in the folder."""
    checkpoint_every: Annotated[float, tyro.conf.arg(metavar="SECONDS"), Bounds(at_least=0.0)] = 15.0
    """Shortest time between two checkpoints; there are none within a segment."""
    progress: bool = True
    """Show a progress bar."""
    workers: Annotated[int, tyro.conf.arg(metavar="N")] = 1
    """Processes that train in parallel, one seed each."""
    cluster: Annotated[str | None, tyro.conf.arg(metavar="NAME")] = None
    """Train on a cluster: ray, at the address in RAY_ADDRESS, a core for each seed. Its nodes share the folder."""
    preset: Annotated[str | None, tyro.conf.arg(metavar="NAME")] = None
    """Options of a preset, or of a file NAME.toml; those on the command line take precedence."""


@dataclasses.dataclass(frozen=True)
class Command:
    """A training by gradients."""

    config: Annotated[APG, tyro.conf.arg(name="")]
    options: Annotated[Options, tyro.conf.arg(name="")]


@dataclasses.dataclass(frozen=True, kw_only=True)
class ByRewards:
    """A training by rewards."""

    config: Annotated[Rewards, tyro.conf.arg(name="")]
    seeds: Annotated[tuple[int, ...], tyro.conf.arg(metavar="N …")] = (0,)
    """One run each, one after the other; the same command continues with those that have not ended."""
    out: Annotated[pathlib.Path, tyro.conf.arg(metavar="DIR")]
    """Folder of the runs; that with seed N has the folder seed-N in it."""


RULES = (
    Rule(("--workers",), lambda given: given.options.cluster is None, "with --cluster"),
    Rule(("--workers",), lambda given: len(set(given.options.seeds)) > 1 or given.options.workers < 2, "on one seed"),
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
  {prog} apg --preset standard --seeds 0 1 2 --workers 2 --out runs/apg
  {prog} apg --preset quick --out runs/apg --resume
  {prog} ppo --env ikgym/Track-v0 --minutes 10 --seeds 0 1 2 --out runs/track-ppo
  {prog} sac --env ikgym/Reach-v0 --total-timesteps 100000 --out runs/reach-sac

Files of a run by rewards, all but apg, in seed-N:
  model.zip          the model, for its library
  agent.safetensors  the agent, for: {evaluate} --policies agent:FILE; none with a history or an LSTM
  curve.csv          CPU seconds, steps, and score on validation episodes: 0 standing still, 1 the best tuned solver
  run.json           at the end: settings, seed and final score

Files of a run of apg, which may be killed at any time:
  run.json           command, seed, versions, a row for each segment, hash of the final weights
  events.out.…       the rows, for: tensorboard --logdir DIR
  checkpoint.pt      the state, for --resume
  agent.safetensors  at the end, the agent, for: {evaluate} --policies agent:FILE

Agents are trained on the seeds of the split "train" and validated on those of "validation"; those of "test" are not
used. The cost ratio is stated where the best known costs of all validation episodes are known."""


def main(arguments: Sequence[str]) -> int:
    """The command line: words after the command; returns the exit code."""
    stopped = "Stopped."

    def work() -> int:
        nonlocal stopped
        command = parse(arguments)
        for name in ("torch", "stable_baselines3", "sb3_contrib", "tensorboard"):
            if importlib.util.find_spec(name) is None:
                raise ModuleNotFoundError(name=name)
        with shell.escaped_output():
            if isinstance(command, ByRewards):
                return _train_by_rewards(command)
            stopped = f"Stopped. The last checkpoint is in {command.options.out}; continue with --resume."
            return _train(command, shlex.join([*_program().split(), *arguments]))

    return shell.run(work, lambda: stopped)


def _program() -> str:
    return shell.program("train", f"python {PROGRAM}")


def parse(arguments: Sequence[str]) -> Command | ByRewards:
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
    command: Command | ByRewards = parse_options(any_of_them, given, prog=_program(), description=manual(), rules=RULES)
    if isinstance(command, ByRewards):
        return dataclasses.replace(command, config=command.config.replace(algorithm=method))
    return command


def _subcommand(method: str, preset: str | None) -> Any:
    """The command of a method; options of apg that are left out are those of the preset."""
    about = METHODS[method]
    if method == "apg":
        default: Any = Command(APG.preset(preset), Options(out=tyro.MISSING))
        return Annotated[Command, tyro.conf.subcommand(method, default=default, description=about)]
    return Annotated[ByRewards, tyro.conf.subcommand(method, description=about)]


def _value_of(option: str, arguments: Sequence[str]) -> str | None:
    """The value of an option that is needed before the others can be read."""
    for argument, following in itertools.zip_longest(arguments, arguments[1:], fillvalue=""):
        name, equals, value = argument.partition("=")
        if name.replace("_", "-") == option:
            return value if equals else following
    return None


def _train_by_rewards(command: ByRewards) -> int:
    from baselines.training import rewards  # imports PyTorch, an extra

    runs = {seed: command.out / f"seed-{seed}" for seed in _checked_seeds(command.seeds)}
    with contextlib.ExitStack() as locks:  # all before the first training, which takes hours
        for folder in runs.values():
            locks.enter_context(locked(folder))
            check_writable(folder)
        for seed, folder in runs.items():
            there = rewards.read_finished(command.config, seed, folder)
            about = there or rewards.train(command.config, seed, folder)
            score = f"score {about['validation_score']:.3f} after {about['steps']} steps"
            print(f"seed {seed}: {score}{', already there' if there else ''}", flush=True)
    print(f"\nwritten to {command.out}")
    return 0


def _train(command: Command, text: str) -> int:
    from baselines.training.run import Job, train_seeds  # imports PyTorch, an extra

    options, jobs = command.options, list[Job]()
    workers = Workers(options.workers, options.cluster)
    names = ("resume", "overwrite", "checkpoint_every")
    given = {name: getattr(options, name) for name in names} | {"command": text}
    for line, seed in enumerate(_checked_seeds(options.seeds)):
        folder, bar = options.out / f"seed-{seed}", line if options.progress else None
        jobs.append(Job(config=command.config, seed=seed, folder=folder, options=given, line=bar))
    results = train_seeds(jobs, workers)
    print(table(results))
    errors = {seed: result for seed, result in results.items() if isinstance(result, str)}
    for seed, error in errors.items():
        print(f"error: seed {seed}: {error}", file=sys.stderr)
    if len(errors) < len(results):
        print(f"\nwritten to {options.out}")
    return 2 if errors else 0


def _checked_seeds(seeds: Sequence[int]) -> tuple[int, ...]:
    """The seeds without repetitions."""
    checked = tuple(dict.fromkeys(whole_number("seeds", seed, at_least=0) for seed in seeds))
    if not checked:
        raise TrainingError("seeds: expected at least one.")
    return checked


def table(results: Mapping[int, Mapping[str, Any] | str]) -> str:
    """A table of seeds and their scores, from the `run.json` of each."""
    lines = [f"{'seed':>4}  {'cost ratio':>8}  {'cost':>10}  {'worst':>8}  {'lost':>6}"]
    for seed, result in results.items():
        if isinstance(result, str):
            lines.append(f"{seed:>4}  failed")
            continue
        score = result["kept"]
        ratio = f"{score['cost_ratio']:.4f}" if "cost_ratio" in score else "–"
        lines.append(f"{seed:>4}  {ratio:>8}  {score['cost']:>10.5g}  {score['worst']:>8.4g}  {score['lost']:>6.1%}")
    return "\n".join(lines)
