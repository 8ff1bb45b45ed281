"""Every scenario, as parameters of tests: those that differ in kind in the fast run, all of them in the slow one."""

import pytest

import ikgym

#: One of each kind among the scenarios that several arms have: task, trajectory, Δt, prismatic joint, random.
KINDS = ("panda-circle", "panda-glue", "panda-singular", "tiago-raster", "iiwa14-random")
#: What solvers are tested on: all scenarios but those that say nothing new of a solver's arithmetic.
ONE_OF_EACH = (*ikgym.scenarios.names("papers"), *KINDS)


def every_scenario(make=lambda name: name):
    """Parameters for :func:`pytest.mark.parametrize`.

    Args:
        make: What a name is turned into.
    """
    fast = {*ONE_OF_EACH}
    names = ikgym.scenarios.names()
    return [pytest.param(make(name), id=name, marks=() if name in fast else pytest.mark.slow) for name in names]
