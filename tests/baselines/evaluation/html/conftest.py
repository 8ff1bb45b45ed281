"""A folder of results with its report, made once for all tests of the page."""

import pytest

from baselines.evaluate import evaluate
from tests.bodied import blocked
from tests.limited import limited

#: A name that must not become markup.
NASTY = '<script>alert(1)</script> <img src=x onerror=alert(2)> {alert(3)} & "co\'"'
STEPS, EPISODES = 450, 3


@pytest.fixture(scope="session")
def folder(tmp_path_factory):
    """Two scenarios, the first of which has limits that are reached; and one in which the arm is stopped by a body."""
    out = tmp_path_factory.mktemp("report")
    scenarios = [limited(steps=STEPS, name=NASTY, dt=0.001), limited(steps=20, name="short")]
    policies = ["dls", "moore_penrose", "dls:damping=0.05", "follow_nominal"]
    evaluate(scenarios, policies, episodes=EPISODES, out=out, report=False)
    evaluate(blocked(), "dls", out=out, resume=True)
    return out
