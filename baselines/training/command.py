"""The command line of `train.py` and `ikgym train`."""

from __future__ import annotations

import contextlib
import dataclasses
import importlib.util
import itertools
import pathlib
import shlex
import sys
import textwrap
from collections.abc import Iterable, Sequence
from typing import Annotated, Any, Generic, TypeVar, Union

import tyro

from baselines import command as shared
from baselines import registry
from baselines.spec import refuse_trust
from baselines.training import methods, presets
from baselines.training.config.base import SHAPE, Config
from baselines.training.errors import TrainingError
from baselines.training.seeds import SeedResult, SeedRuns, train_seeds
from baselines.workers import ALONE, Workers
from ikgym import scenarios
from ikgym.exceptions import InvalidInputError, MissingDependencyError
from ikgym.validation import whole_number

PROGRAM = "train.py"


@dataclasses.dataclass(frozen=True, kw_only=True)
class Options:
    """Where to, and how: nothing of this changes what comes of a seed."""

    out: Annotated[pathlib.Path, tyro.conf.arg(metavar="DIR")]
    """Folder for the files; the run with seed N has the folder seed-N in it."""
    seeds: Annotated[tuple[int, ...], tyro.conf.arg(metavar="N …")] = (0,)
    """One run each."""
    workers: Annotated[int, tyro.conf.arg(metavar="N")] = 1
    """Processes that train at the same time, one seed each."""
    cluster: Annotated[str | None, tyro.conf.arg(metavar="NAME")] = None
    """Train on a cluster: ray, at the address in RAY_ADDRESS, a core for each seed. Its nodes share the folder."""
    preset: Annotated[str | None, tyro.conf.arg(metavar="NAME")] = None
    """Options of a preset, or of a file that ends in .toml; those on the command line take precedence."""
    resume: bool = False
    """Go on with the runs in the folder; they end with the same weights as if they had never been stopped."""
    overwrite: bool = False
    """Replace the runs in the folder."""
    checkpoint_every: Annotated[float, tyro.conf.arg(metavar="SECONDS")] = 15.0
    """Shortest time between two checkpoints; there are none within a segment."""
    study: Annotated[int | None, tyro.conf.arg(metavar="N")] = None
    """Search options by Optuna instead: N trainings with one seed, judged on validation episodes, of which those that
    are worse than the median of the others are ended early. --workers trains some at the same time. The best options
    are written into the folder as a preset, best.toml."""
    study_ranges: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="FILE.toml")] = None
    """What --study tries: a table for the method, with a range for each option. Its own ranges if left out."""
    progress: bool = True
    """Show a progress bar."""


C = TypeVar("C", bound=Config)


@dataclasses.dataclass(frozen=True)
class Command(Generic[C]):
    """A method with its configuration."""

    config: Annotated[C, tyro.conf.arg(name="")]
    options: Annotated[Options, tyro.conf.arg(name="")]


@dataclasses.dataclass(frozen=True)
class Repeat:
    """Repeats a run from its run.json, and compares the final weights; exit code 1 where they differ."""

    run: Annotated[tyro.conf.Positional[pathlib.Path], tyro.conf.arg(metavar="RUN_JSON")]
    """The run.json of a run."""
    out: Annotated[pathlib.Path, tyro.conf.arg(metavar="DIR")]
    """Folder for the files."""
    resume: bool = False
    """Go on with the repetition in the folder."""
    overwrite: bool = False
    """Replace the run in the folder."""
    checkpoint_every: Annotated[float, tyro.conf.arg(metavar="SECONDS")] = 15.0
    """Shortest time between two checkpoints."""
    progress: bool = True
    """Show a progress bar."""


def manual() -> str:
    """The text of ``--help`` above the options."""
    prog, evaluate = _program(), shared.program("evaluate", "python -m baselines.evaluate")
    return f"""\
Trains agents: networks from observations to joint velocities, alone or as residual policies on a base policy.
Each method has options of its own: {prog} METHOD --help

{_listing("Methods", methods.METHODS)}

{_listing("Presets", presets.names())}

{_listing("Scenarios", scenarios.names())}

{_listing("Policies for --base-policy", (name for name in registry.names() if not registry.get(name).reference))}

Examples:
  {prog} ppo --preset smoke --out runs/smoke
  {prog} ppo --base-policy dls:damping=1e-2 --action-scale 0.5 --seeds 0 1 2 3 4 --workers 2 --out runs/residual-dls
  {prog} imitate --preset residual --seeds 0 1 2 3 4 --workers 2 --out runs/residual
  {prog} apg --preset quick --out runs/apg
  {prog} ppo --preset finetune --init runs/imitate/seed-0/model.safetensors --out runs/finer
  {prog} ppo --preset smoke --out runs/smoke --resume
  {prog} ppo --preset smoke --study 30 --workers 2 --out runs/study
  {prog} repeat runs/smoke/seed-0/run.json --out runs/again

Files in the folder of a run, each replaced in one go, so that it may be stopped or killed at any time:
  run.json           all that is needed to repeat it, its validation, what it has cost, the hash of its final weights
  history.json       a row a segment
  tensorboard/       the same, for: tensorboard --logdir DIR
  checkpoint.pt      where it stands, for --resume
  model.safetensors  at the end, the kept model with its critics, for --init; not of apg and observe
  model.zip          at the end, the same model, for Stable-Baselines3; not of apg and observe
  agent.safetensors  at the end, its actor, for --init and for: {evaluate} --policies agent:FILE;
                     of observe for: {evaluate} --policies recurrent:FILE

Agents are trained on the seeds of the split "train" and validated on those of "validation"; those of "test" are not
used. Where there is a reference, the cost ratio is the geometric mean of the costs over those of rhc_foresight."""


def _listing(title: str, names: Iterable[str]) -> str:
    return textwrap.fill(f"{title}: {', '.join(names)}.", 100, subsequent_indent="  ", break_on_hyphens=False)


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line.

    Args:
        arguments: What stands behind the command; taken from the process if left out.

    Returns:
        The exit code: 0; 1 where a repetition came to other weights; 2 where something expected went wrong, be it in
        one seed of several; 130 after Ctrl-C.
    """
    arguments = sys.argv[1:] if arguments is None else list(arguments)
    out: pathlib.Path | None = None

    def work() -> int:
        nonlocal out
        command, given = parse(arguments)
        _require_extra()
        if isinstance(command, Repeat):
            out = command.out
            return _repeat(command)
        out = command.options.out
        return _train(command, given, shlex.join([*_program().split(), *arguments]))

    def stopped() -> str:
        kept = "" if out is None else f" What was done up to the last checkpoint is in {out}; go on with --resume."
        return f"Stopped.{kept}"

    return shared.run(work, stopped)


def _program() -> str:
    return shared.program("train", f"python {PROGRAM}")


def _require_extra() -> None:
    """Insists on the packages that only the training needs.

    Raises:
        MissingDependencyError: One is missing.
    """
    missing = [name for name in ("torch", "stable_baselines3", "tensorboard") if importlib.util.find_spec(name) is None]
    if missing:
        raise MissingDependencyError(f'Training needs {", ".join(missing)}: pip install "ikgym[train]"')


def parse(arguments: Sequence[str]) -> tuple[Command[Any] | Repeat, frozenset[str]]:
    """What a command line asks for.

    Returns:
        The command, and the names of the options in :data:`baselines.training.config.base.SHAPE` that it gives, be it
        by a preset.

    Raises:
        UnknownNameError: There is no such preset, or the method has no option that the preset gives.
        InvalidInputError: A value is refused, or there is no method.
        SystemExit: With 0 after ``--help``, with 2 where the options are none.
    """
    if not arguments:
        with contextlib.suppress(SystemExit):
            parse(["--help"])
        raise InvalidInputError(f"expected a method, one of {', '.join(methods.METHODS)}, or repeat; got none.")
    chosen = next((argument for argument in arguments if argument in methods.METHODS), None)
    preset = _value_of("--preset", arguments)
    given = {name for name in SHAPE if _value_of(f"--{name.replace('_', '-')}", arguments) is not None}
    kinds: list[Any] = []
    for name, method in methods.METHODS.items():
        config, of_preset = presets.configure(method.config, preset if name == chosen else None)
        default: Any = Command(config, Options(out=tyro.MISSING))
        summary = (method.config.__doc__ or "").strip()
        generic: Any = Command
        kinds.append(
            Annotated[generic[method.config], tyro.conf.subcommand(name, default=default, description=summary)]
        )
        given |= of_preset
    kinds.append(Annotated[Repeat, tyro.conf.subcommand("repeat")])
    any_of_them: Any = Union[tuple(kinds)]  # noqa: UP007  # made at run time
    command: Command[Any] | Repeat = shared.parse(any_of_them, arguments, prog=_program(), description=manual())
    return command, frozenset(given)


def _value_of(option: str, arguments: Sequence[str]) -> str | None:
    """The value of an option that is needed before the others can be read."""
    for argument, following in itertools.zip_longest(arguments, arguments[1:], fillvalue=""):
        name, equals, value = argument.partition("=")
        if name.replace("_", "-") == option:
            return value if equals else following
    return None


def _train(command: Command[Any], given: frozenset[str], text: str) -> int:
    # PyTorch takes seconds to load, and --help needs none.
    from baselines.training.trainers.initial_weights import inherit

    options = command.options
    seeds = tuple(dict.fromkeys(whole_number("seeds", seed, at_least=0) for seed in options.seeds))
    if not seeds:
        raise TrainingError("seeds: expected at least one.")
    runs = SeedRuns(
        inherit(command.config, given),
        options.out,
        resume=options.resume,
        overwrite=options.overwrite,
        checkpoint_every=options.checkpoint_every,
        command=text,
    )
    workers = Workers(options.workers, options.cluster)
    if options.study is not None:
        return _study(runs, seeds, options, whole_number("study", options.study, at_least=1))
    if options.study_ranges is not None:
        raise InvalidInputError("study_ranges: expected --study, the number of trials, beside it.")
    results = train_seeds(runs, seeds, workers=workers, progress=options.progress)
    print(table(results))
    for result in results:
        if result.error:
            print(f"error: seed {result.seed}: {result.error}", file=sys.stderr)
    print(f"\nwritten to {options.out}")
    return 2 if any(result.error for result in results) else 0


def _study(runs: SeedRuns, seeds: Sequence[int], options: Options, trials: int) -> int:
    # Only a search needs Optuna.
    from baselines.training.study import BEST, searched

    if len(seeds) > 1:
        raise InvalidInputError(f"seeds: expected one for a study, got {', '.join(map(str, seeds))}.")
    if options.cluster is not None:
        raise InvalidInputError("--cluster: a study runs on this machine; expected --workers.")
    given: dict[str, Any] = {"trials": trials, "ranges": options.study_ranges, "workers": options.workers}
    print(searched(runs, seeds[0], **given, progress=options.progress))
    print(f"\nwritten to {options.out}; train with --preset {options.out / BEST}")
    return 0


def _repeat(command: Repeat) -> int:
    from baselines.training.folder import read_run

    about = read_run(command.run)
    wanted = about.get("weights_sha256")
    if not wanted:
        raise TrainingError(f"{command.run} is of a run that has not ended: finish it with --resume.")
    for name in {"base_policy", "expert"} & about["config"].keys():
        if about["config"][name] is not None:
            refuse_trust(about["config"][name], f"{command.run}: {name}")
    config = methods.get(about["method"]).config.from_json(about["config"])
    runs = SeedRuns(
        config,
        command.out,
        resume=command.resume,
        overwrite=command.overwrite,
        checkpoint_every=command.checkpoint_every,
        command=shlex.join([*_program().split(), "repeat", str(command.run)]),
    )
    (result,) = train_seeds(runs, [about["seed"]], workers=ALONE, progress=command.progress)
    if result.error:
        raise TrainingError(result.error)
    if result.weights_sha256 == wanted:
        print(f"The same final weights, bit for bit: {wanted}")
        return 0
    print(f"Other final weights: expected {wanted}, got {result.weights_sha256}.")
    for line in _reasons(about, read_run(runs.folder(about["seed"]) / "run.json")):
        print(line)
    return 1


def _reasons(there: dict[str, Any], here: dict[str, Any]) -> Iterable[str]:
    """What may have led to other weights."""
    for part in ("scenario", "init", "versions", "machine"):
        if there.get(part) != here.get(part):
            yield f"  {part}: {there.get(part)} there, {here.get(part)} here"


def table(results: Sequence[SeedResult]) -> str:
    """Seeds and their scores, as text."""
    lines = [f"{'seed':>4}  {'cost ratio':>8}  {'cost':>10}  {'worst':>8}  {'lost':>6}"]
    for result in results:
        if result.score is None:
            lines.append(f"{result.seed:>4}  failed")
            continue
        score = result.score
        cost_ratio = "–" if score.cost_ratio is None else f"{score.cost_ratio:.4f}"
        lines.append(f"{result.seed:>4}  {cost_ratio:>8}  {score.cost:>10.5g}  {score.worst:>8.4g}  {score.lost:>6.1%}")
    return "\n".join(lines)
