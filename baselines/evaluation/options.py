"""The options of an evaluation, the same from Python and on the command line."""

from __future__ import annotations

import dataclasses
import pathlib
from typing import Annotated, Literal

import tyro

from baselines.evaluation.export import formats
from baselines.evaluation.foreign import Wrap
from baselines.workers import Workers
from ikgym.exceptions import InvalidInputError
from ikgym.scenarios import Preview
from ikgym.scenarios.preview import offsets
from ikgym.validation import whole_number


@dataclasses.dataclass(frozen=True)
class Options:
    """Options of :func:`baselines.evaluate.evaluate` and of the command.

    Names may be given as one text or as several; `out` may be text, too.

    Raises:
        UnknownNameError: There is no such format or cluster.
        InvalidInputError: A number is out of range, the preview is invalid, or `export` is given without `out`.
    """

    test_sets: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME …")] = ()
    """Test sets, which define what is played, instead of scenarios, episodes, split, steps and noise seeds."""
    episodes: Annotated[int, tyro.conf.arg(metavar="N")] = 1
    """Episodes of each random scenario: the first seeds of the split. Other scenarios are the same at every reset and
    have one episode, with seed 0."""
    split: Annotated[str, tyro.conf.arg(metavar="NAME")] = "test"
    """Seeds of random scenarios: train, validation or test."""
    steps: Annotated[int | None, tyro.conf.arg(metavar="N")] = None
    """Most steps of an episode, for trials. The scenario's own number if left out."""
    preview: Annotated[Preview | None, tyro.conf.arg(metavar="P …")] = None
    """Number of steps ahead that policies are shown, or several numbers for just those steps, such as 1 10 40. What
    each policy needs if left out."""
    wrap: Annotated[Wrap | None, tyro.conf.Fixed, tyro.conf.Suppress] = None
    """Wraps the environment for policies that are no :class:`baselines.SolverPolicy`, as an agent needs it that was
    trained in a wrapped one: ``wrap(env) -> env``. Costs and errors are those of the environment inside."""
    timed: Annotated[int | Literal["all"], tyro.conf.arg(metavar="N|all")] = 1
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
    plots: bool = True
    """Draw plots into the folder."""
    report: bool = True
    """Write report.html into the folder: table, plots and replays in one page that opens without a network."""
    export: Annotated[tuple[str, ...], tyro.conf.arg(metavar="FORMAT …")] = ()
    """Write the joint motion of each episode into the folder: csv for a table of times, joint coordinates and
    velocities, joint-trajectory for a ROS 2 message as JSON, or both."""
    noise_seeds: Annotated[int, tyro.conf.arg(metavar="N")] = 1
    """Times that each episode is played, each time with other noise in sensors and drives, the same for all policies.
    Episodes without noise are played once. The cost of an episode is the geometric mean over its noise seeds."""
    pairs: bool = False
    """Also play each scenario whose plant is not ideal with an ideal one, with the same seeds, to show how much the
    plant costs each policy."""
    progress: Annotated[bool, tyro.conf.Fixed, tyro.conf.Suppress] = False
    """Show a progress bar on stderr."""

    def __post_init__(self) -> None:
        for name in ("test_sets", "export"):
            value = getattr(self, name)
            object.__setattr__(self, name, (value,) if isinstance(value, str) else tuple(value))
        object.__setattr__(self, "export", formats(self.export))
        if self.out is not None:
            object.__setattr__(self, "out", pathlib.Path(self.out))
        elif self.export:
            raise InvalidInputError("export: expected a folder for the files, `out` or --out; got none.")
        for name in ("episodes", "noise_seeds"):
            whole_number(name, getattr(self, name), at_least=1)
        if self.steps is not None:
            whole_number("steps", self.steps, at_least=1)
        if self.timed != "all":
            whole_number("timed", self.timed, at_least=1)
        if self.preview is not None:
            offsets(self.preview)
        Workers(self.workers, self.cluster)
