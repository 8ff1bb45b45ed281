"""The command line: ``python -m baselines.leaderboard``."""

from __future__ import annotations

import dataclasses
import datetime
import pathlib
from collections.abc import Iterator, Sequence
from typing import Annotated, Any, Final, Literal

import tyro
from matplotlib.figure import Figure

from baselines import command as shared
from baselines.evaluation.machine import describe
from baselines.evaluation.pages import cost_time, families, foresight, leaderboard, rivals, sets, tuning
from baselines.evaluation.pages.choosing import page as choosing
from baselines.evaluation.pages.entries import FORESIGHT, HORIZONS, Entry, agents, playing, shipped, solvers
from baselines.evaluation.pages.measure import measure
from baselines.evaluation.pages.measurement import Measurement, Section
from baselines.evaluation.pages.renewal import renewed
from baselines.evaluation.pages.submissions.add import add
from baselines.evaluation.plots.style import small_png
from baselines.files import write
from baselines.files.locks import locked
from baselines.workers import Workers
from ikgym.exceptions import InvalidInputError

#: The names of the pages on the command line.
Page = Literal["leaderboard", "cost-time", "foresight", "leaderboard-skew", "rivals", "choosing"]
LEADERBOARD: Final = "leaderboard"
COST_TIME: Final = "cost-time"
FORESIGHT_PAGE: Final = "foresight"
RIVALS: Final = "rivals"
CHOOSING: Final = "choosing"
#: The pages that need the extra `rivals`, and have no plots.
REAL_ARMS: Final = {RIVALS: rivals.page, CHOOSING: choosing.page}
#: The leaderboards, and the main test set of each.
LEADERBOARDS: Final = {LEADERBOARD: sets.MAIN, "leaderboard-skew": sets.SKEW}


@dataclasses.dataclass(frozen=True)
class Options:
    """What the command line takes."""

    pages: Annotated[tuple[Page, ...], tyro.conf.arg(metavar="PAGE …")] = (LEADERBOARD, COST_TIME, FORESIGHT_PAGE)
    """The pages: leaderboard, cost-time, foresight, leaderboard-skew, rivals, choosing. What several need is played
    once. If left out the first three: leaderboard-skew stands on the papers' own skew coordinates, the last two need
    the extra rivals."""
    out: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="DIR")] = None
    """Folder for the results. If left out nothing is played, and --write writes the pages anew from what lies beside
    them."""
    write: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="DIR")] = None
    """Folder for the pages, such as docs; what was measured goes beside each as .json, plots into images/. That of the
    results if left out."""
    agents: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME=DIR …")] = ()
    """Agents for the leaderboard besides those that come with the package: what to call each, and the folder of its
    training seeds, with DIR/seed-N/agent.safetensors and DIR/seed-N/run.json."""
    sets: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME …")] = ()
    """Test sets and scenarios of the cost-time page. If left out the test sets of whole poses, and the fixed scenarios
    but for those that hold their points. Those of the last two pages likewise, all paths of real arms if left out."""
    add: Annotated[tuple[pathlib.Path, ...], tyro.conf.arg(metavar="FOLDER …")] = ()
    """Submissions, see docs/rules.md: each is checked, scored on the sets of the leaderboard, and added to the page in
    --write; its rows go into --out."""
    renew: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME …")] = ()
    """Lines of the leaderboard, by their names: these alone are played, those of --agents among them, and stand in the
    page in --write, whose other lines stay as they are; their rows go into --out."""
    trust: bool = False
    """Run the code in submissions: only in folders whose maker you know."""
    episodes: Annotated[int | None, tyro.conf.arg(metavar="N")] = None
    """The first so many episodes of each set, for trials."""
    quick: bool = False
    """A trial: some solvers, two episodes, one seed of each policy."""
    resume: bool = False
    """Continue with the results in the folder: what is done already is not done again."""
    overwrite: bool = False
    """Delete the results in the folder."""
    workers: Annotated[int, tyro.conf.arg(metavar="N")] = 1
    """Processes that play what is not timed. What is timed is played in one, after that."""
    cluster: Annotated[str | None, tyro.conf.arg(metavar="NAME")] = None
    """Play what is not timed on a cluster: ray, at the address in RAY_ADDRESS."""


#: What the command is called where Python has run its module.
PROGRAM = "python -m baselines.leaderboard"


def manual(prog: str) -> str:
    """The text of ``--help`` above the options."""
    return f"""\
Plays trained agents and all solvers on test sets and scenarios, and writes the leaderboard, the cost-time page and the
foresight page.

Examples:
  {prog} --out results/pages --agents "PPO=results/ppo" --write docs
  {prog} --pages cost-time --out results/quick --quick
  {prog} --pages rivals choosing --out results/arms --write docs
  {prog} --add examples/submission --out results/added --write docs
  {prog} --renew PPO --agents "PPO=results/ppo" --out results/renewed --write docs
  {prog} --write docs

Files:
  DIR/SET/results.json             rows as those of evaluate
  leaderboard.md, cost_time.md …   what the numbers say, tables and plots
  leaderboard.json …               what they are made from
  images/*.png                     the plots"""


#: Who plays in a quick trial.
QUICK = ("dls", "mfac", "rhc_gradient", *HORIZONS[:2], FORESIGHT)
#: What a quick trial of the cost-time page plays, and the horizons.
QUICK_SETS, SHORT = (sets.MAIN, "varga7-fast"), (3, 10, 30)


def measured(options: Options, command: str) -> dict[str, Measurement]:
    """What the pages are made from: played, or read from the files beside them.

    Raises:
        IkgymError: Something expected went wrong, see :func:`baselines.evaluation.pages.measure.measure`.
    """
    if options.out is None:
        if options.write is None:
            raise InvalidInputError(
                "Expected --out, where the results go, or --write, the folder of the pages to be written anew."
            )
        if options.agents:
            raise InvalidInputError("--agents are played: expected --out, where the results go.")
        return {page: _read(_file(options.write, page).with_suffix(".json")) for page in options.pages}
    entered, workers = _entered(options), _workers(options)
    found: dict[str, dict[str, Section]] = {page: {} for page in options.pages}
    for name in dict.fromkeys(name for by_set in entered.values() for name in by_set):
        sections = measure(
            name,
            {page: by_set[name] for page, by_set in entered.items() if name in by_set},
            options.out,
            episodes=2 if options.quick and options.episodes is None else options.episodes,
            workers=workers,
            resume=options.resume,
            overwrite=options.overwrite,
            progress=True,
        )
        for page, section in sections.items():
            found[page][name] = section
    # What several pages need was played with the first of them; each page keeps its own order.
    ordered = {page: tuple(found[page][name] for name in by_set) for page, by_set in entered.items()}
    return {page: Measurement(command, _today(), _machine(page), sections) for page, sections in ordered.items()}


def extended(options: Options, command: str) -> dict[str, Measurement]:
    """The leaderboards with the submissions of ``--add`` and the lines of ``--renew``.

    Raises:
        IkgymError: Something expected went wrong, see :func:`baselines.evaluation.pages.submissions.add.add` and
            :func:`baselines.evaluation.pages.renewal.renewed`.
    """
    option = "--add" if options.add else "--renew"
    if options.out is None or options.write is None:
        raise InvalidInputError(
            f"{option}: expected --out, where the rows go, and --write, the folder of the leaderboard."
        )
    pages = [page for page in options.pages if page in LEADERBOARDS]
    if not pages:
        raise InvalidInputError(f"{option}: expected some of {', '.join(LEADERBOARDS)} in --pages.")
    how: dict[str, Any] = {
        "resume": options.resume, "overwrite": options.overwrite, "workers": _workers(options), "progress": True,
    }  # fmt: skip
    found: dict[str, Measurement] = {page: _read(_file(options.write, page).with_suffix(".json")) for page in pages}
    for page, one in found.items():
        if options.add:
            # What was measured before keeps the command that measured it.
            one = add(one, options.add, options.out / page, date=_today(), trust=options.trust, **how)
        if options.renew:
            everyone = _everyone(options, page)
            one = renewed(one, everyone, options.renew, options.out / page, command=command, date=_today(), **how)
        found[page] = one
    return found


def draw_up(measurement: Measurement, page: str, folder: pathlib.Path) -> None:
    """Writes a page, its plots, and what they are made from.

    Raises:
        ResultsError: A file cannot be written.
        MissingDependencyError: There is no scipy.
    """
    file = _file(folder, page)
    with locked(folder):
        measurement.save(file.with_suffix(".json"))
        for where, figure in pictures(measurement, page):
            write(folder / where, small_png(figure))
        write(file, text(measurement, page).encode())


def pictures(measurement: Measurement, page: str) -> Iterator[tuple[pathlib.PurePath, Figure]]:
    """The plots of a page, and where they lie, seen from it."""
    if page in LEADERBOARDS:
        return leaderboard.pictures(measurement, page)
    if page in REAL_ARMS:
        return iter(())
    return foresight.pictures(measurement) if page == FORESIGHT_PAGE else cost_time.pictures(measurement)


def text(measurement: Measurement, page: str) -> str:
    """A page as Markdown.

    Raises:
        ResultsError: The settings of the tuned solvers cannot be read.
        MissingDependencyError: There is no scipy.
    """
    if page in LEADERBOARDS:
        return leaderboard.page(measurement, tuning.of(LEADERBOARDS[page]), page)
    if page in REAL_ARMS:
        return REAL_ARMS[page](measurement)
    return foresight.page(measurement) if page == FORESIGHT_PAGE else cost_time.page(measurement)


def _workers(options: Options) -> Workers:
    """Who plays what is not timed."""
    return Workers(options.workers, options.cluster)


def _entered(options: Options) -> dict[str, dict[str, list[Entry]]]:
    """Who plays what, by page and set of episodes."""
    out: dict[str, dict[str, list[Entry]]] = {}
    for page, main in LEADERBOARDS.items():
        if page in options.pages:
            out[page] = {name: playing(name, _everyone(options, page), main) for name in sets.leaderboard(main)}
    if COST_TIME in options.pages:
        names = options.sets or (QUICK_SETS if options.quick else sets.cost_time())
        compared = families.entries(SHORT if options.quick else families.HORIZONS)
        first = [dataclasses.replace(one, variants=one.variants[:1], seeds=one.seeds[:1]) for one in compared]
        out[COST_TIME] = {name: first if options.quick else list(compared) for name in names}
    if FORESIGHT_PAGE in options.pages:
        out[FORESIGHT_PAGE] = {name: list(foresight.entries()) for name in sets.foresight()}
    if RIVALS in options.pages:
        names = options.sets or (rivals.QUICK_SETS if options.quick else sets.rivals())
        out[RIVALS] = {name: list(rivals.entries()) for name in names}
    if CHOOSING in options.pages:
        names = options.sets or (rivals.QUICK_SETS if options.quick else choosing.played())
        out[CHOOSING] = {name: list(choosing.entries(name)) for name in names}
    return out


def _everyone(options: Options, page: str) -> list[Entry]:
    """Who plays for a leaderboard."""
    tuned = tuning.of(LEADERBOARDS[page]).settings
    return [*agents(options.agents), *shipped(), *_quick(options, solvers(tuned))]


def _machine(page: str) -> dict[str, object]:
    """What a page was measured on and with."""
    return describe() | (rivals.versions() if page in REAL_ARMS else {})


def _quick(options: Options, everyone: Sequence[Entry]) -> list[Entry]:
    return [one for one in everyone if one.name in QUICK or not options.quick]


def _read(file: pathlib.Path) -> Measurement:
    written = Measurement.load(file)
    if changed := [one.name for one in written.sections if one.stale]:
        raise InvalidInputError(f"{', '.join(changed)}: changed since it was measured; measure again with --out.")
    return written


def _file(folder: pathlib.Path, page: str) -> pathlib.Path:
    return folder / f"{page.replace('-', '_')}.md"


def _today() -> str:
    return datetime.datetime.now(datetime.UTC).date().isoformat()


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line.

    Args:
        arguments: What stands behind the command; taken from the process if left out.

    Returns:
        The exit code: 0, 2 where something expected went wrong, 130 after Ctrl-C.
    """
    return shared.run_resumable(Options, arguments, shared.program("leaderboard", PROGRAM), manual, _work)


def _work(options: Options, command: str) -> None:
    folder = options.write or options.out or pathlib.Path()
    make = extended if options.add or options.renew else measured
    for page, measurement in make(options, command).items():
        draw_up(measurement, page, folder)
        print(f"written to {_file(folder, page)}")
