"""Kernels: the cheapest joint path through the knots of a time grid.

A receding horizon solves at each step the problem that the oracle solves for a whole episode: a joint
path that is piecewise linear in time. Its knots are the unknowns, its slopes the joint velocities.

There are two Newton methods, and each is needed. Without limits the method of multipliers (:mod:`minimise`) takes a
third of the time of the interior point method (:mod:`interior_point`) to the same optimum (`rhc`: 0.35 and 0.33 times
on `varga7-pose-random` and `varga7-random`), and in real time it costs less: with the latter `rhc_foresight` costs 1.24
times as much on 8 validation episodes of the former set, and loses one of 6 of the latter. On ordinary paths of arms
with limits multipliers do as well (0.995 (0.992 to 0.999) on 24 episodes of `panda-random`, in 0.23 times the time);
where the limits are active they cost 4 times as much (`panda-fast`) to 200 times (`panda-edge`).

Among bodies that may not touch, the interior point method has the clearance at each knot as one more limit
(:mod:`clearance`).

Arguments of most kernels:

- ``problem``: a :class:`workspace.PathProblem` of K knots.
- ``path``: joint coordinates at the knots in [rad] or [m]. Shape (K, n).
- ``multipliers``: λ₀ of each knot: of its e errors, its n velocities and its n joint coordinates. Shape (K, e + 2 n).
- ``workspace``: a :class:`workspace.NewtonWorkspace`.
"""
