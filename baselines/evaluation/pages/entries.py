"""What is measured for the leaderboard: all solvers as they are and tuned, and trained agents from their folders."""

from __future__ import annotations

import dataclasses
import pathlib
import re
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

from baselines import registry
from baselines.agents import files, untrusted
from baselines.agents.policy import LearnedPolicy
from baselines.agents.shipped import ShippedAgent
from baselines.evaluation.pages.sets import MAIN, get
from baselines.files import ResultsError, json_files
from baselines.solvers.receding_horizon.rhc import RecedingHorizon
from baselines.spec import parse_policy
from ikgym.exceptions import InvalidInputError

#: How far the receding horizon of Varga 2021 looks ahead: HL = 3 grid points, of which one is the present.
PAPER = 2
#: The preset that draws at random, whose best seed is the reference where no best known cost is.
FORESIGHT = "rhc_foresight"
#: Receding horizons beside those that are registered: the paper's, to the optimum and with one iteration, and long
#: ones with move blocks.
BLOCKED = (
    "rhc:horizon=100,iterations=1,move_blocks=23",
    "rhc:horizon=200,iterations=1,move_blocks=27",
    "rhc:horizon=400,iterations=1,move_blocks=30",
)
#: The same for a policy that is shown the full orientation.
FULL_ORIENTATION = tuple(
    f"full_orientation:policy=rhc,options={{'horizon': {horizon}, 'iterations': 1, 'move_blocks': {blocks}}}"
    for horizon, blocks in ((100, 23), (400, 30))
)
HORIZONS = ("rhc:horizon=3", "rhc:horizon=3,iterations=1", "rhc:horizon=100", *BLOCKED, *FULL_ORIENTATION)
#: The solvers that are also played where no solver was tuned and no agent trained, as they are and tuned.
GENERAL = (
    *("dls", "full_orientation", "null_space", "mfac", "rhc_gradient"),
    *(*HORIZONS[:2], *BLOCKED, *FULL_ORIENTATION, FORESIGHT),
)
#: Solvers made for arms with limits, and for arms that are not their model. The arms of these pages are neither.
FOR_OTHER_ARMS = (
    *("qp", "sns"),
    *("offset_free", "calibrated", "predicted"),
)
#: Training seeds below which a mean over them is no benchmark.
ENOUGH = 5
#: Episodes of each policy that are played with the clock.
TIMED = 2
#: The share of a set's episodes, the first ones, that is played by who takes longer than all others together would:
#: receding horizons to the optimum over more steps than this, and with more knots than this.
FEWER, COSTLY_HORIZON, COSTLY_KNOTS = 1 / 8, 30, 150
#: Seeds of a policy that draws at random.
SEEDS = (0, 1, 2)


@dataclasses.dataclass(frozen=True)
class Training:
    """What the training of an agent has cost.

    Args:
        method: Such as ``"ppo"``.
        base_policy: The base policy of a residual agent; None where there is none.
        steps: Environment steps, or samples, of each training seed.
        core_minutes: Minutes times cores of each training seed.
    """

    method: str
    base_policy: str | None
    steps: tuple[int, ...]
    core_minutes: tuple[float, ...]


@dataclasses.dataclass(frozen=True)
class Entry:
    """A line of a table, to be measured: one policy, or the same policy with several seeds.

    Args:
        name: What it is called: a solver's spec, or the name of an agent.
        variants: Name and parameters of the policy, for each of its seeds.
        seeds: Those seeds; none where nothing is drawn at random.
        settings: Parameters that were searched on validation episodes; none for a solver as it is, and for agents.
        training: What it has cost to train; None for solvers.
        timed: Episodes of each seed that are played with the clock.
        share: Of the episodes, the first ones, that it plays.
    """

    name: str
    variants: tuple[tuple[str, Mapping[str, Any]], ...]
    seeds: tuple[int, ...] = ()
    settings: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    training: Training | None = None
    timed: int = TIMED
    share: float = 1.0

    @property
    def label(self) -> str:
        """What tells it from all others."""
        return label(self.name, self.settings)

    @property
    def general(self) -> bool:
        """Whether it is played on changed scenarios, too."""
        return self.training is not None or self.name in GENERAL


def label(name: str, settings: Mapping[str, Any]) -> str:
    """What to call a solver or an agent, so that one that was tuned differs from itself as it is."""
    return f"{name}, tuned" if settings else name


def short(name: str) -> str:
    """The name of a solver where there is little room: ``full_orientation rhc:horizon=3`` for a wrapper."""
    if ":" not in name:
        return name
    outer, parameters = parse_policy(name)
    inner, options = parameters.pop("policy", None), parameters.pop("options", {})
    if inner is None or parameters:
        return name
    return f"{outer} {inner}" + (":" + ",".join(f"{key}={value}" for key, value in options.items()) if options else "")


def compared(*besides: type) -> list[str]:
    """Specs of the registered policies that pages compare, but for references, examples, rivals and these classes."""
    classes = {name: registry.get(name) for name in registry.names() if name not in FOR_OTHER_ARMS}
    special = {name for name, kind in classes.items() if kind.reference or kind.example or kind.rival}
    return [name for name, kind in classes.items() if name not in special and not issubclass(kind, besides)]


def solvers(tuned: Mapping[str, Mapping[str, Any]] = MappingProxyType({})) -> tuple[Entry, ...]:
    """All registered solvers as they are, some receding horizons, and what tuning made of them.

    References, which have privileged information, are left out, and so are examples for one scenario, solvers of other
    projects, and agents, see :func:`shipped` and :func:`agents`; and so are :data:`FOR_OTHER_ARMS`.

    Args:
        tuned: The best settings of solvers, by their specs; one that they do not change is not listed twice.
    """
    names = compared(LearnedPolicy)
    better = (solver(spec, settings) for spec, settings in tuned.items() if settings)
    return (*map(solver, (*names, *HORIZONS)), *better)


def solver(spec: str, settings: Mapping[str, Any] = MappingProxyType({}), *, timed: int = TIMED) -> Entry:
    """A solver; one that draws at random is entered with several seeds.

    Args:
        spec: Its name and parameters, see :data:`baselines.spec.PolicySpec`.
        settings: Parameters that were searched.
        timed: Episodes that are played with the clock, of each seed.
    """
    name, parameters = parse_policy(spec)
    given, kind = {**parameters, **settings}, registry.get(name)
    # Parameters that depend on the arm are known when a policy is made.
    horizon = kind.for_scenario(get(MAIN), **given) if issubclass(kind, RecedingHorizon) else None
    draws = horizon is not None and (horizon.starts > 1 or horizon.restart_steps > 0)
    share = FEWER if horizon is not None and _costly(horizon) else 1.0
    if not draws:
        return Entry(spec, ((name, given),), settings=dict(settings), timed=timed, share=share)
    seeded = tuple((name, {**given, "seed": seed}) for seed in SEEDS)
    return Entry(spec, seeded, SEEDS, dict(settings), timed=timed, share=share)


def first_seed(entry: Entry, share: float = 1.0) -> Entry:
    """The same with one seed alone, on the first part of the episodes.

    Args:
        entry: Who plays.
        share: Of the episodes that it plays.
    """
    return dataclasses.replace(entry, variants=entry.variants[:1], seeds=(), share=share)


def _costly(policy: RecedingHorizon) -> bool:
    """Whether a receding horizon takes so long that it plays fewer episodes."""
    to_the_optimum = policy.iterations is None and policy.horizon > COSTLY_HORIZON
    return to_the_optimum or len(policy.offsets) > COSTLY_KNOTS


def playing(name: str, entries: Sequence[Entry], main: str = MAIN) -> list[Entry]:
    """Who plays a set of a leaderboard: all on its main test set; agents and some solvers, untimed, elsewhere."""
    return [
        one if name == main else dataclasses.replace(one, timed=0) for one in entries if name == main or one.general
    ]


def shipped() -> tuple[Entry, ...]:
    """The agents that come with the package, each with the one training seed that was kept."""
    classes = {name: registry.get(name) for name in registry.names()}
    return tuple(_shipped(name, kind) for name, kind in classes.items() if issubclass(kind, ShippedAgent))


def _shipped(name: str, kind: type[ShippedAgent]) -> Entry:
    about = files.parse_agent(name, untrusted.read(kind.folder / f"{name}{untrusted.SUFFIX}")).about
    trained, cost = about["training"], about["training"]["training"]
    training = Training(
        trained["method"], about["processing"].get("base_policy"), (cost["steps"],), (cost["core_minutes"],)
    )
    return Entry(name, ((name, {}),), (trained["seed"],), training=training)


def agent(name: str, directory: pathlib.Path) -> Entry:
    """A trained agent: a folder with a folder ``seed-N`` for each training seed.

    Args:
        name: What to call it.
        directory: Where ``seed-*/agent.safetensors`` and ``seed-*/run.json`` lie.

    Raises:
        ResultsError: There is no training seed, a file is missing or damaged, or the seeds were trained differently.
    """
    folders = {int(found[1]): f for f in directory.glob("seed-*") if (found := re.fullmatch(r"seed-(\d+)", f.name))}
    if not folders:
        raise ResultsError(f"{directory}: expected folders seed-0, seed-1, …, each with an agent; there is none.")
    runs = [_run(folders[seed] / "run.json") for seed in sorted(folders)]
    kinds = {(method, base_policy) for method, base_policy, _, _ in runs}
    if len(kinds) > 1:
        raise ResultsError(f"{directory}: expected seeds of one training, got {' and '.join(sorted(map(str, kinds)))}.")
    method, base_policy, *_ = runs[0]
    return Entry(
        name,
        tuple(policy_of(folders[seed]) for seed in sorted(folders)),
        tuple(sorted(folders)),
        training=Training(method, base_policy, tuple(run[2] for run in runs), tuple(run[3] for run in runs)),
    )


def agents(given: Sequence[str]) -> tuple[Entry, ...]:
    """The agents that the command line names.

    Args:
        given: ``NAME=DIR`` each.

    Raises:
        InvalidInputError: A text has another form, or two agents, or an agent and a solver, share a name.
        ResultsError: See :func:`agent`.
    """
    taken = {entry.name for entry in (*solvers(), *shipped())}
    out: dict[str, Entry] = {}
    for text in given:
        name, _, directory = (part.strip() for part in text.partition("="))
        if not (name and directory):
            raise InvalidInputError(f"--agents: expected NAME=DIR, got {text!r}.")
        if name in out or name in taken:
            raise InvalidInputError(f"--agents: the name {name!r} is taken; expected one of its own for each agent.")
        out[name] = agent(name, pathlib.Path(directory))
    return tuple(out.values())


def policy_of(folder: pathlib.Path) -> tuple[str, dict[str, Any]]:
    """The policy of one training seed, from its folder.

    Raises:
        ResultsError: There is no agent in it.
    """
    file = folder / "agent.safetensors"
    if not file.is_file():
        raise ResultsError(f"{file} is missing: export the agent, or remove its folder.")
    return "agent", {"path": str(file)}


def _run(file: pathlib.Path) -> tuple[str, str | None, int, float]:
    """Method, base policy, steps and core-minutes of a training."""
    try:
        content = json_files.read(file)
        training, base_policy = content["training"], content["processing"].get("base_policy")
        if not (base_policy is None or isinstance(base_policy, str)):
            raise TypeError(f"base_policy: expected the spec of a policy or null, got {base_policy!r}")
        return str(content["method"]), base_policy, int(training["steps"]), float(training["core_minutes"])
    except (OSError, ValueError, TypeError, KeyError, AttributeError) as e:
        raise ResultsError(f"Cannot read what a training has cost from {file}: {e!r}.") from None
