"""Varga 2021: what is claimed, and how it is tested, with the thresholds."""

from __future__ import annotations

from baselines.papers.paper import Claim
from baselines.papers.varga import effort, motion

CLAIMS = (
    Claim(
        "printed step",
        "The descent with α between 1e-8 and 5e-4 solves the fast task.",
        "section IV",
        "`rhc_gradient` on both readings of the arm, α starting anew at 1e-8 in each control step (restart) or kept, "
        "the warm start as it was (unshifted) or shifted, which the text leaves open: no step blows up",
        effort.printed_step,
    ),
    Claim(
        "limit reached",
        "In most of the time the maximal number of 450 steps was reached.",
        "section IV, fig. 6",
        "share of control steps with 450 descent steps in the same readings: more than half",
        effort.limit_reached,
    ),
    Claim(
        "offline only",
        "Each step takes around 1 s; the method is mainly for offline applications.",
        "section IV, fig. 6; section VI",
        "`varga7-fast`, median wall time of a control step, finite differences if not said: longer than the 1 ms of "
        "the grid; of all its steps until the stop test, and of the first 100 with the 450 steps that the paper has "
        "in most of them",
        effort.offline,
    ),
    Claim(
        "time proportional",
        "The time of a control step is proportional to its steps of the descent.",
        "section IV, fig. 6",
        "`varga7-fast`: time per gradient, of which a descent takes one more than steps, in the tenths of the calls "
        "with the fewest and with the most: less than a tenth apart",
        effort.time_proportional,
    ),
    Claim(
        "multipliers cost more",
        "Without Lagrange multipliers and reduced gradient the solution is considerably less complex.",
        "abstract",
        "median time of a call of `rhc_lagrange` on `varga7-fast`, with `states`, that is X kept as unknown beside "
        "q and q̇ as in eq. 3, and with X eliminated, over that of `rhc_gradient`: 1.5 or more",
        effort.lagrange,
    ),
    Claim(
        "acceptable precision",
        "A relatively fast motion is tracked with acceptable precision.",
        "section IV, fig. 2 and 3",
        "largest errors on `varga7-fast`; acceptable is not said to be what",
        motion.acceptable,
    ),
    Claim(
        "slow is finer",
        "A much slower motion is tracked more precisely.",
        "section IV, fig. 7 and 8",
        "largest position errors on `varga7-fast` and `varga7-slow`: more is a tenth or more",
        motion.slow_is_finer,
    ),
    Claim(
        "fast fluctuates",
        "With the fast motion the joint velocities fluctuate considerably.",
        "section IV, fig. 5",
        "`varga7-fast` without its first twentieth, α restarted and kept (up to 1e-4, since it diverges with 5e-4): "
        "a joint velocity changes by more than a tenth of its peak within a step",
        motion.fast_fluctuates,
    ),
    Claim(
        "slow fluctuates",
        "With the slow motion more significant fluctuations of the joint velocities occur.",
        "section IV, fig. 10",
        "second differences of the velocities without the first twentieth, absolute and relative, α restarted and "
        "kept: more is a tenth or more",
        motion.slow_fluctuates,
    ),
    Claim(
        "other joint paths",
        "Nominal and actual joint paths differ: the solution is ambiguous, and an optimal one was chosen.",
        "section IV, fig. 4",
        "largest distance of the joint coordinates from the nominal ones: more than 0.05 rad or m",
        motion.other_joints,
    ),
    Claim(
        "velocities bounded",
        "Penalties for high joint velocities handle singularities better than the pseudoinverse.",
        "abstract, section III",
        "peak joint velocity beside that of `moore_penrose`: better is a tenth or more",
        motion.bounded,
    ),
    Claim(
        "smoothing calms",
        "Second-order smoothing significantly reduces the fluctuation of the joint velocities.",
        "section V, fig. 11",
        "second differences (without the first twentieth) and total variation before and behind `smoothed`, "
        "Λ = 300 / s, α restarted and kept: significantly is 1.5 times or more",
        motion.smoother,
    ),
    Claim(
        "smoothing errs",
        "With smoothed trajectories the tracking error is significantly higher.",
        "section V, fig. 13 and 14",
        "largest position errors with and without the wrapper: significantly is 1.5 times or more",
        motion.smoothing_errs,
    ),
    Claim(
        "skew part determines",
        "The independent elements of the rotation matrix can be expressed from its skew-symmetric part.",
        "section III, eq. 7 and 8",
        "share of the nominal paths beyond 90°, where another rotation has the same skew part: none",
        motion.skew_determines,
    ),
)
