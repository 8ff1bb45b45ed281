"""The text of ``python -m baselines.evaluate --help`` above the options."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable

from baselines import command, registry
from baselines.evaluation import report, test_sets
from ikgym import scenarios


def manual() -> str:
    """What is played, examples, files and columns."""
    policies = (name + (" (reference)" if report.is_reference(name) else "") for name in registry.names())
    prog = command.program("evaluate", "python -m baselines.evaluate")
    return f"""\
Plays every policy on every scenario, and measures costs, errors, joint velocities and the time per step.

{_listing("Scenarios", scenarios.names())}

{_listing("Test sets", test_sets.names())}

{_listing("Policies", (*policies, "agent:PATH (an agent in a file)", "package.module:Class"))}

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
  report.html   tables that sort and filter, plots, and replays of the arms: open it in a browser
  plots/        for each scenario: tracking and errors, joint velocities, joint paths, cost against time
  series/       what the plots show, as .npz
  export/       with --export, the joint motion of each episode

Columns:
  scenario, policy, parameters, seed, steps      which episode it is
  total_cost = tracking_cost + velocity_cost     sum of -reward
  cost_ratio                                     total_cost / best known cost, null where there is none above 1e-9
  position_error_max, position_error_rms         distance from the nominal position in [m]
  orientation_error_max, orientation_error_rms   geodesic angle in [rad], null where the task has none
  qdot_peak, qdot_rms, qdot_total_variation      of the joint velocities, in [rad/s] or [m/s]
  qddot_peak                                     their largest change in a step over dt, in [rad/s²] or [m/s²]
  steps_at_joint_limit, steps_at_velocity_limit, steps_at_acceleration_limit
                                                 steps in which the arm held a joint back: at a stop, at its velocity
                                                 or at its acceleration limit
  joint_limit_margin_min                         smallest distance of a joint from a limit in [rad] or [m], null where
                                                 the arm has none
  time_first_us                                  wall time of the first call of the policy in [µs]
  time_p50_us, time_p99_us                       that of the later calls, null where the episode was not timed
  deadline_misses                                later calls that were longer than the time step of the scenario
  status                                         the worst of the episode, unknown where the policy says none
  machine                                        CPU, cores and versions
  iterations, status_counts                      mean iterations in one step, null where nobody counts, and how many
                                                 steps ended how
  preview                                        steps ahead that were shown, the furthest of some
  fingerprint                                    digest of the scenario and the version of the cost
  test_set                                       digest of the test set, null where there is none
  arm_seed                                       which arm moved, null where the reset seed said so
  noise_seed                                     which noise there was, 0 is that of the reset seed
  ideal                                          fingerprint of the scenario with an ideal plant

Costs and errors of scenarios that hold their nominal points are those of the last step of each point."""


def _listing(title: str, names: Iterable[str]) -> str:
    return textwrap.fill(f"{title}: {', '.join(names)}.", 100, subsequent_indent="  ", break_on_hyphens=False)
