"""Policies whose package may be missing, and scenarios that suit them."""

from __future__ import annotations

import pytest

import baselines
from baselines.registry import get
from ikgym.exceptions import MissingDependencyError


def usual(name):
    """A scenario that suits a policy: solvers of other projects know no skew coordinates."""
    return "zhang6-lspb" if get(name).rival else "varga7-fast"


def made(name, on, **parameters):
    """The policy; where its package is not installed the test is skipped and says so."""
    try:
        return baselines.make(name, on, **parameters)
    except MissingDependencyError as e:
        assert get(name).rival
        pytest.skip(str(e))
