"""The command ``ikgym evaluate``, or ``python -m baselines.evaluate``."""

from __future__ import annotations

import dataclasses
import pathlib
import shlex
import sys
import textwrap
from collections.abc import Iterable, Sequence
from typing import Annotated

import tyro

from baselines import registry
from baselines.cli import shell
from baselines.evaluation import report, test_sets
from baselines.evaluation.jobs import Options
from baselines.evaluation.results import PAGE
from baselines.evaluation.run import carry_out
from ikgym import scenarios

#: The columns of a row, for ``--help``.
COLUMNS = """\
  scenario, policy, parameters, seed, steps      identify the episode, with arm_seed and noise_seed below
  total_cost = tracking_cost + velocity_cost     sum of -reward
  cost_ratio                                     total_cost / best known cost, null if none above 1e-9 is known
  position_error_max, position_error_rms         distance from the reference position in [m]
  orientation_error_max, orientation_error_rms   geodesic angle in [rad], null if the task has no orientation
  qdot_peak, qdot_rms, qdot_total_variation      of the joint velocities, in [rad/s] or [m/s]
  qddot_peak                                     largest change of a joint velocity in a step over dt, in [rad/s²] or
                                                 [m/s²]
  steps_at_joint_limit, steps_at_velocity_limit, steps_at_acceleration_limit
                                                 steps in which a stop, the velocity or the acceleration limit of the
                                                 arm held a joint back
  joint_limit_margin_min                         smallest distance of a joint from a limit in [rad] or [m], null if the
                                                 arm has none
  time_first_us                                  wall time of the first call of the policy in [µs]
  time_p50_us, time_p99_us                       wall time of later calls, null if the episode was not timed
  deadline_misses                                later calls that took longer than the time step of the scenario
  status                                         worst status of the episode, unknown if the policy reports none
  machine                                        CPU, cores and versions
  iterations, status_counts                      mean iterations of a step, null if unknown; steps by status
  preview                                        furthest step ahead that was shown
  fingerprint                                    digest of the scenario and the version of the cost
  test_set                                       digest of the test set, null if there is none
  arm_seed                                       seed of the arm, null if the reset seed sets it
  noise_seed                                     seed of the noise, 0 is the noise of the reset seed
  ideal                                          fingerprint of the scenario with an ideal plant"""


@dataclasses.dataclass(frozen=True)
class Arguments:
    """Arguments of the command line."""

    scenarios: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME …")] = ()
    """Names of scenarios, FILE.toml, MODULE:ATTRIBUTE, or: all. If neither scenarios nor test sets are given:
    varga7-fast."""
    policies: Annotated[tuple[str, ...], tyro.conf.arg(metavar="POLICY …")] = ("all",)
    """Policies as NAME or NAME:PARAMETER=VALUE,PARAMETER=VALUE, agent:PATH for an agent in a file, MODULE:CLASS for
    one of your own, also of a module in the current folder, or: all."""
    options: Annotated[Options, tyro.conf.arg(name="")] = dataclasses.field(default_factory=Options)
    """Options of the evaluation."""


def manual() -> str:
    """The text of ``--help`` above the options."""
    prog = _program()
    return f"""\
Plays every policy on every scenario, and measures costs, errors, joint velocities and the time per step.

{_listing("Scenarios", scenarios.names())}

{_listing("Test sets", test_sets.names())}

{_listing("Policies", (*registry.names(), "agent:PATH (an agent in a file)", "package.module:Class"))}

Examples:
  {prog}
  {prog} --policies dls dls:damping=1e-2 rhc_gradient:alpha_max=5e-4,horizon=5
  {prog} --scenarios varga7-random --episodes 20 --workers 4 --out results/random
  {prog} --scenarios varga7-random --episodes 50 --out results/random --resume
  {prog} --test-sets varga7-pose-random --policies rhc_gradient --out results/test
  {prog} --test-sets panda-camera --pairs --policies dls rhc told --out results/camera
  {prog} --scenarios varga7-random --policies agent:runs/mine.safetensors dls
  {prog} --scenarios lab.toml --policies dls --out results/lab --export csv joint-trajectory
  {prog} --scenarios lab.toml my_module:scenario --policies my_module:MyPolicy dls

Files in the folder of --out, each replaced in one go, so that a run may be stopped at any time:
  results.json  a list of rows, one an episode, written anew after each batch
  results.csv   the same as a table
  README.md     tables, plots and conditions
  report.html   a table that sorts and filters, plots, and replays of the arms: open it in a browser
  plots/        for each scenario: tracking and errors, joint velocities, joint paths, cost against time
  series/       the data of the plots, as .npz
  export/       with --export, the joint motion of each episode

Columns:
{COLUMNS}

Where a scenario holds its reference points for several steps, costs and errors are those of the last step of each
point."""


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line.

    Args:
        arguments: The words after the command; those of the process if left out.

    Returns:
        The exit code: 0, 2 after an expected error, 130 after Ctrl-C.
    """
    arguments = sys.argv[1:] if arguments is None else list(arguments)
    out: pathlib.Path | None = None

    def work() -> int:
        nonlocal out
        given = shell.parse(Arguments, arguments, prog=_program(), description=manual())
        options = dataclasses.replace(given.options, progress=True)
        out = options.out
        shell.find_own_modules()
        carry_out(
            given.scenarios or (() if options.test_sets else ("varga7-fast",)),
            given.policies,
            options,
            command=shlex.join([*_program().split(), *arguments]),
            show=lambda rows: print(report.table(rows, rows.skipped, width=shell.width()), flush=True),
        )
        if out is not None:
            print(f"\nwritten to {out}" + (f"; open {out / PAGE} in a browser" if options.report else ""))
        return 0

    return shell.run(
        work, lambda: "Stopped." if out is None else f"Stopped. Finished episodes are in {out}; continue with --resume."
    )


def _program() -> str:
    return shell.program("evaluate", "python -m baselines.evaluate")


def _listing(title: str, names: Iterable[str]) -> str:
    return textwrap.fill(f"{title}: {', '.join(names)}.", 100, subsequent_indent="  ", break_on_hyphens=False)
