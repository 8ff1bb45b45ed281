"""The options of an evaluation, and its jobs: scenarios × policies × episodes, all checked before one is played."""

from __future__ import annotations

import dataclasses
import itertools
import pathlib
import sys
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro

from baselines.episodes import Policy, Seeds
from baselines.evaluation import test_sets
from baselines.evaluation.metrics import AT_MARGIN, Key, Skipped
from baselines.evaluation.policies import (
    ALL,
    AnyPolicy,
    Specification,
    UnsuitedError,
    shown_preview,
    specification,
    specifications,
)
from baselines.files import ResultsError, canonical
from baselines.fingerprints import fingerprint
from baselines.oracle.stripped import ideal
from ikgym import scenarios as scenario_registry
from ikgym.exceptions import InvalidInputError
from ikgym.frozen import Frozen
from ikgym.scenarios import Preview, Scenario
from ikgym.scenarios.preview import offsets
from ikgym.validation import Bounds

if TYPE_CHECKING:
    from baselines.workers import Workers

#: The scenario whose plant is at this severity, of the worst one that its map shows.
FIELD, SEVERITY = "panda-field", 0.5


def _words(metavar: str, default: str) -> Any:
    """An option of words on the command line, and of any objects in Python."""
    return tyro.conf.arg(constructor=tuple[str, ...], metavar=metavar, help_behavior_hint=default)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Options(Frozen):
    """Options of the command and of :func:`baselines.evaluate.evaluate`, which takes scenarios and policies as objects.

    Names may be given as one text or as several; `out` may be text, too.

    Raises:
        UnknownNameError: There is no such format or cluster.
        InvalidInputError: A number is out of range, the preview is invalid, or `export` is given without `out`.
    """

    scenarios: Annotated[Any, _words("NAME …", "(default: varga7-fast without test sets)")] = ()
    """Names of scenarios, FILE.toml, MODULE:ATTRIBUTE, or: all."""
    policies: Annotated[Any, _words("POLICY …", "(default: all)")] = (ALL,)
    """Policies as NAME or NAME:PARAMETER=VALUE,PARAMETER=VALUE, agent:PATH for an agent in a file, MODULE:CLASS for
    a class of yours, also of a module in the current folder, or: all."""
    test_sets: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME …")] = ()
    """Test sets, which define the episodes, instead of scenarios, episodes, split, steps and noise seeds."""
    episodes: Annotated[int, tyro.conf.arg(metavar="N"), Bounds(at_least=1)] = 1
    """Episodes of each random scenario: the first seeds of the split. Other scenarios are the same at every reset and
    have one episode, with seed 0."""
    split: Annotated[str, tyro.conf.arg(metavar="NAME")] = "test"
    """Seeds of random scenarios: train, validation or test."""
    steps: Annotated[int | None, tyro.conf.arg(metavar="N"), Bounds(at_least=1)] = None
    """Most steps of an episode, for trials. The number of the scenario if left out."""
    preview: Annotated[Preview | None, tyro.conf.arg(metavar="P …")] = None
    """Number of steps ahead that policies are shown, or several numbers for just those steps, such as 1 10 40. The
    policy's preview if left out."""
    wrap: Annotated[Any, tyro.conf.Fixed, tyro.conf.Suppress] = None
    """Wraps the environment for policies that are no :class:`baselines.SolverPolicy`, as an agent needs it that was
    trained in a wrapped one: ``wrap(env) -> env``. Costs and errors are those of the environment inside."""
    timed: Annotated[int | Literal["all"], tyro.conf.arg(metavar="N|all"), Bounds(at_least=1)] = 1
    """Episodes of each policy in each scenario that are played one by one and timed. The others are played together,
    which is faster, and have no times."""
    workers: Annotated[int, tyro.conf.arg(metavar="N")] = 1
    """Processes that play episodes. They change only the times, which are most reliable with one."""
    cluster: Annotated[str | None, tyro.conf.arg(metavar="NAME")] = None
    """Play untimed episodes on a cluster: ray, at the address in RAY_ADDRESS. Timed episodes are played here."""
    out: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="DIR")] = None
    """Folder for the files. Nothing is written if left out."""
    resume: bool = False
    """Continue with the results in the folder: finished episodes are not played again."""
    overwrite: bool = False
    """Replace the results in the folder."""
    report: bool = True
    """Write report.html into the folder: table, plots and replays in one page that opens without a network."""
    export: Annotated[tuple[str, ...], tyro.conf.arg(metavar="FORMAT …")] = ()
    """Write the joint motion of each episode: csv; joint-trajectory, a ROS 2 message as JSON; mcap, it for rosbag2."""
    accelerations: bool = False
    """Write accelerations into these files, too: controllers then interpolate by quintics, else cubically."""
    noise_seeds: Annotated[int, tyro.conf.arg(metavar="N"), Bounds(at_least=1, at_most=10_000)] = 1
    """Times that each episode is played, each time with other noise in sensors and drives, the same for all policies.
    Episodes without noise are played once. The cost of an episode is the geometric mean over its noise seeds."""
    pairs: bool = False
    """Also play each scenario whose plant is not ideal with an ideal one, with the same seeds, to show how much the
    plant costs each policy."""
    leaderboard: bool = False
    """Write a table into the folder, too, in which policies are ranked by cost ratio, with intervals, and plots of cost
    against time. Agents in DIR/seed-N/ are training seeds of one agent and share a line, DIR."""
    severities: Annotated[tuple[float, ...], tyro.conf.arg(metavar="S …")] = ()
    """Play one scenario with its plant at all pairs of these severities, of unknown properties (calibration, payload,
    camera) and of the drives (lag, delay), and write a map of cost ratios. 1 is the plant itself, in panda-field the
    worst one, and 0 an ideal one."""
    progress: Annotated[bool, tyro.conf.Fixed, tyro.conf.Suppress] = False
    """Show a progress bar on stderr."""
    command: Annotated[str, tyro.conf.Fixed, tyro.conf.Suppress] = "baselines.evaluate.evaluate(…)"
    """The command that README.md and the report state."""

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("test_sets", "export", "severities"):
            value = getattr(self, name)
            self._settle(**{name: (value,) if isinstance(value, (str, float)) else tuple(dict.fromkeys(value))})
        if self.out is not None:
            self._settle(out=pathlib.Path(self.out))
        if self.export:
            from baselines.evaluation.export import check_formats

            check_formats(self.export)
            if self.out is None:
                raise InvalidInputError("export: expected a folder for the files, `out` or --out; got none.")
        if self.preview is not None:
            offsets(self.preview)
        _ = self.pool  # checks workers and cluster

    @property
    def pool(self) -> Workers | None:
        """The workers; None where this process plays all episodes."""
        if (self.workers, self.cluster) == (1, None):
            return None
        from baselines.workers import Workers

        return Workers(self.workers, self.cluster)


@dataclasses.dataclass(frozen=True, eq=False)
class Job:
    """One episode to be played."""

    scenario: Scenario
    specification: Specification  # the policy, not yet bound to the scenario
    parameters: Mapping[str, Any]  # parameters of the bound policy, as rows have them
    seeds: Seeds  # the random seeds of the episode
    first: bool  # whether it is the first episode of its policy in its scenario; its trajectory log is kept
    record: bool  # whether the record of the episode is needed, for the log or for an export
    timed: bool  # whether it is played alone and timed
    preview: Preview  # steps ahead that the policy is shown, or which ones
    test_set: str | None = None  # digest of the test set of the episode; None if it belongs to none
    # number of episodes that the same arm plays before, with reset seeds that end at this one's; the policy keeps
    # its state
    before: int = 0

    @property
    def policy(self) -> str:
        """The name of the policy."""
        return self.specification.name

    @property
    def arguments(self) -> dict[str, Any]:
        """The parameters of the policy's constructor for this episode."""
        return self.specification.arguments(self.scenario, self.seeds)

    @property
    def fingerprint(self) -> str:
        """Digest of the scenario, see :func:`baselines.fingerprints.fingerprint`."""
        return fingerprint(self.scenario)

    @property
    def key(self) -> Key:
        """The key of the row to come."""
        return self.scenario.name, self.policy, canonical(self.parameters), self.seeds, self.scenario.steps

    def bind(self) -> Policy:
        """The policy; refused if the file behind it has changed since the evaluation began."""
        policy = self.specification.bind(self.scenario, self.seeds, self.preview)
        now = self.specification.parameters(self.scenario, policy)
        if now != self.parameters:
            raise ResultsError(f"{self.policy} has changed since the evaluation began: {self.parameters} is now {now}.")
        return policy


def plan(options: Options) -> tuple[list[Job], list[Skipped]]:
    """All episodes of an evaluation, policy by policy within each scenario, and the policies that are skipped.

    Raises:
        UnknownNameError: There is no such scenario, policy, parameter, split or test set.
        InvalidInputError: A value is out of range, two scenarios share a name, no policy suits any scenario, or a test
            set has drifted or is given with options that it defines.
        ResultsError: The file of an agent cannot be used.
    """
    timed = sys.maxsize if options.timed == ALL else int(options.timed)
    policies = specifications(options.policies, wrap=options.wrap)
    jobs: dict[Key, Job] = {}
    skipped: list[Skipped] = []
    for (scenario, seeds, test_set, length), one in itertools.product(_episodes(options), policies):
        try:
            first = _first_job(one, scenario, seeds[0], options.preview)
        except UnsuitedError as e:
            skipped.append(Skipped(scenario.name, one.name, str(e)))
            continue
        per_episode = one.per_episode(scenario)
        for number, draw in enumerate(seeds):
            job = dataclasses.replace(
                first,
                seeds=draw,
                first=number == 0,
                record=number == 0 or bool(options.export),
                timed=number < timed,
                test_set=test_set,
                # A reference is bound to one episode, and has nothing to learn from those before.
                before=0 if per_episode or draw.arm_seed is None else draw.seed - draw.arm_seed * length,
            )
            jobs.setdefault(job.key, job)
    if not jobs:
        reasons = "; ".join(f"{one.policy} in {one.scenario}: {one.reason}" for one in skipped)
        raise InvalidInputError(f"Nothing to evaluate: {reasons or 'no scenario or no policy given.'}")
    return list(jobs.values()), skipped


def job_of(policy: AnyPolicy, scenario: Scenario, seed: int, preview: Preview | None = None, wrap: Any = None) -> Job:
    """The job of one policy in one episode, which is timed and recorded.

    Raises:
        UnknownNameError: There is no such policy or parameter.
        InvalidInputError: The policy does not suit the scenario, or is shown too little.
    """
    one = specification(policy, wrap=wrap)
    try:
        return _first_job(one, scenario, Seeds(seed), preview)
    except UnsuitedError as e:
        raise InvalidInputError(f"{one.name} does not suit {scenario.name}: {e}") from e


def _first_job(one: Specification, scenario: Scenario, seeds: Seeds, preview: Preview | None) -> Job:
    policy = one.bind(scenario, seeds, preview)
    parameters, shown = one.parameters(scenario, policy), shown_preview(policy, preview)
    return Job(scenario, one, parameters, seeds, first=True, record=True, timed=True, preview=shown)


#: Episodes of a scenario: seeds of each, digest of their test set, and how many one arm plays in a row.
_Episodes = tuple[Scenario, tuple[Seeds, ...], str | None, int]


def _episodes(options: Options) -> list[_Episodes]:
    """The episodes of all scenarios or test sets; with the same seeds those at delay margins, and on ideal plants."""
    if options.test_sets:
        changed = (options.episodes, options.split, options.steps, options.noise_seeds) != (1, "test", None, 1)
        if options.scenarios or changed or options.severities:
            raise InvalidInputError(
                f"A test set defines the episodes: with {', '.join(map(repr, options.test_sets))}, expected no "
                "scenarios, episodes, split, steps, noise_seeds or severities."
            )
        sets = map(test_sets.get, options.test_sets)
        out = [_draw(one.scenario, one.seeds, one.noise_seeds, one.digest, one.sequence) for one in sets]
    else:
        several = scenario_registry.seeds(options.split, options.episodes)
        out = [
            # A scenario that is the same at every reset is played once.
            _draw(one, several if one.varies else (0,), options.noise_seeds, length=test_sets.sequence(one.name))
            for one in _scenarios(options)
        ]
    if not options.severities:
        out += [(at_margin(one[0]), *one[1:]) for one in out if one[0].plant.delay_margin]
    if options.pairs:
        known, names = {fingerprint(scenario) for scenario, *_ in out}, dict[str, str]()
        for scenario, seeds_of, *_ in list(out):
            plain = ideal(scenario)
            if (content := fingerprint(plain)) not in known:
                name = names.setdefault(content, f"{scenario.name}, ideal plant")
                out.append(_draw(plain.replace(name=name), dict.fromkeys(one.seed for one in seeds_of)))
    return out


def at_margin(scenario: Scenario) -> Scenario:
    """A scenario whose commands come later by the delay margin of its plant."""
    return scenario.replace(name=scenario.name + AT_MARGIN, plant=scenario.plant.at_margin())


def _draw(
    scenario: Scenario, seeds: Iterable[int], noise_seeds: int = 1, test_set: str | None = None, length: int = 1
) -> _Episodes:
    """The episodes of reset seeds; each is played once if there is no noise."""
    times = noise_seeds if scenario.plant.noisy else 1
    every = (Seeds(seed, seed // length if length > 1 else None, noise) for seed in seeds for noise in range(times))
    return scenario, tuple(every), test_set, length


def _scenarios(options: Options) -> list[Scenario]:
    """The scenarios of an evaluation, each once, at all severities."""
    items, out = options.scenarios, dict[str, Scenario]()
    for item in (items,) if isinstance(items, (str, Scenario)) else items:
        names = scenario_registry.names() if isinstance(item, str) and item == ALL else (item,)
        for scenario in map(scenario_registry.find, names):
            known = out.setdefault(scenario.name, scenario)
            if known is not scenario and fingerprint(known) != fingerprint(scenario):
                raise InvalidInputError(
                    f"Two different scenarios are called {scenario.name!r}: rename one with "
                    "scenario.replace(name=…), so that their results can be distinguished."
                )
    scenarios = list(out.values())
    if options.severities:
        if len(scenarios) != 1 or scenarios[0].plant.ideal:
            raise InvalidInputError(
                "severities: expected one scenario whose plant is not ideal, got "
                f"{', '.join(map(repr, out)) or 'none'}."
            )
        scenarios = at_severities(scenarios[0], options.severities)
    if options.steps is None:
        return scenarios
    return [scenario.replace(steps=min(options.steps, scenario.steps)) for scenario in scenarios]


def at_severities(scenario: Scenario, severities: Sequence[float]) -> list[Scenario]:
    """A scenario with its plant at all pairs of severities: of calibration, payload and camera; of lag and delay."""
    # The plant of panda-field in the catalogue is at a severity in between.
    field = scenario.name == FIELD and scenario.plant == scenario_registry.get(FIELD).plant
    plant = scenario.plant.scaled(1.0 / SEVERITY) if field else scenario.plant
    return [
        scenario.replace(name=f"{scenario.name} {knowledge:g} {drives:g}", plant=plant.scaled(knowledge, drives))
        for knowledge, drives in itertools.product(sorted({*severities}), repeat=2)
    ]
