"""The registry of policies: names without imports, policies of others, and what is refused."""

import dataclasses
import functools
import importlib.metadata
import sys
from typing import ClassVar

import numpy as np
import pytest

import baselines
from baselines import registry
from baselines.evaluate import evaluate
from baselines.policy import Solution, SolverPolicy, statuses
from baselines.registry import parse_policy
from baselines.solvers.resolved_rate.dls import DampedLeastSquares
from ikgym.exceptions import InvalidInputError, UnknownNameError
from tests.baselines.evaluation.planning import planned


@dataclasses.dataclass(frozen=True, eq=False)
class Still(SolverPolicy):
    """Does not move, and gives itself no name."""

    def solve(self, batch, memory):
        rows = len(batch.q)
        return Solution(np.zeros_like(batch.q), memory, statuses(rows), np.zeros(rows, dtype=np.int64))


@dataclasses.dataclass(frozen=True, eq=False)
class Misnamed(Still):
    """Calls itself what another policy is registered by."""

    name: ClassVar[str] = "dls"


class Looking(Still):
    """Must be shown two steps ahead."""

    @property
    def preview(self):
        return 2


@pytest.fixture(autouse=True)
def unchanged(monkeypatch):
    """What a test registers is forgotten after it."""
    monkeypatch.setattr(registry, "_import_paths", dict(registry._import_paths))
    monkeypatch.setattr(registry, "_classes", dict(registry._classes))


@pytest.fixture
def entry_points(monkeypatch):
    """Installed packages of others."""

    def install(**places):
        found = [importlib.metadata.EntryPoint(name, value, registry.GROUP) for name, value in places.items()]
        monkeypatch.setattr(importlib.metadata, "entry_points", lambda group: found)
        monkeypatch.setattr(registry, "_entry_points", functools.cache(registry._entry_points.__wrapped__))

    return install


@pytest.mark.parametrize("name", baselines.names())
def test_names_of_ours_lead_to_classes_of_that_name(name):
    assert registry.get(name).name == name
    assert registry.name_of(registry.get(name)) == name


def test_a_registered_class_is_a_policy_like_others():
    baselines.register("still", Still)
    assert baselines.names()[-1 - len(registry._entry_points())] == "still"
    assert baselines.get("still") is Still
    assert isinstance(baselines.make("still", "zhang3-helix"), Still)
    rows = evaluate("zhang3-helix", ["still"], steps=3)
    assert [(row.policy, row.solver_status) for row in rows] == [("still", "applied")]
    assert "still" in {job.policy for job in planned("zhang3-helix", "all", steps=2).jobs}


def test_a_registered_place_is_imported_when_it_is_asked_for(tmp_path, monkeypatch):
    (tmp_path / "lazy_module.py").write_text(
        "from baselines.solvers.resolved_rate.dls import DampedLeastSquares\nclass Lazy(DampedLeastSquares): pass\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    baselines.register("lazy", "lazy_module:Lazy")
    assert "lazy" in baselines.names()
    assert "lazy_module" not in sys.modules
    (row,) = evaluate("zhang3-helix", "lazy:damping=1e-2", steps=3)
    assert (row.policy, row.parameters["damping"]) == ("lazy", 1e-2)
    assert row.total_cost == evaluate("zhang3-helix", "dls:damping=1e-2", steps=3)[0].total_cost


def test_results_have_the_registered_name_whatever_the_class_calls_itself():
    baselines.register("mine", Misnamed)
    rows = evaluate("zhang3-helix", ["mine", Misnamed, baselines.make("mine", "zhang3-helix"), "dls"], steps=3)
    assert [row.policy for row in rows] == ["mine", "dls"]  # three ways to say the same, done once
    assert rows[0].total_cost != rows[1].total_cost


def test_messages_name_a_class_without_a_name():
    assert (Still.name, Looking.name, DampedLeastSquares.name) == ("Still", "Looking", "dls")
    baselines.register("looking", Looking)
    with pytest.raises(InvalidInputError, match="Looking needs to be shown 2 steps ahead"):
        evaluate("zhang3-helix", "looking", steps=3, preview=1)
    with pytest.raises(InvalidInputError, match=r"the one that Looking\.predict returned"):
        baselines.make("looking", "zhang3-helix")._recall((1,), None, 1)


class Unfinished(SolverPolicy):
    """Solves nothing."""


@pytest.mark.parametrize(
    ("name", "place", "message"),
    [
        *(
            ("mine", place, r"expected 'package\.module:attribute', got")
            for place in ("dls", "package.module:", ":Class", "a:b:c", "a b:C", 3)
        ),
        *((name, Still, "expected a name of letters, digits") for name in ("", "a b", ".a", 3)),
        *((name, Still, "is registered already") for name in ("dls", "agent")),
        ("mine", dict, "expected a class derived from SolverPolicy"),
        ("mine", Unfinished, "Unfinished': the class lacks solve"),
    ],
)
def test_what_is_refused_leaves_nothing_behind(name, place, message):
    before = baselines.names()
    with pytest.raises(InvalidInputError, match=message):
        baselines.register(name, place)
    assert baselines.names() == before


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "ModuleNotFoundError: No module named 'other_module'"),
        ("x = 1", "no attribute 'Policy' of other_module"),
        ("class Policy(", "SyntaxError"),
        ("raise RuntimeError('no licence')", "RuntimeError: no licence"),
        ("Policy = 3", "expected a class derived from SolverPolicy, got 3"),
    ],
)
def test_places_that_lead_nowhere(tmp_path, monkeypatch, content, message):
    if content is not None:
        (tmp_path / "other_module.py").write_text(content)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "other_module", raising=False)
    baselines.register("mine", "other_module:Policy")
    with pytest.raises(InvalidInputError, match=message):
        baselines.get("mine")
    monkeypatch.delitem(sys.modules, "other_module", raising=False)


def test_an_import_path_is_as_good_as_a_name():
    path = f"{DampedLeastSquares.__module__}:{DampedLeastSquares.__qualname__}"
    assert parse_policy(f"{path}:gain=0.5") == parse_policy((path, {"gain": 0.5})) == (path, {"gain": 0.5})
    assert baselines.make(path, "zhang3-helix", gain=0.5).parameters["gain"] == 0.5
    assert isinstance(baselines.make("smoothed", "varga7-fast", policy=path).inner, DampedLeastSquares)
    with pytest.raises(UnknownNameError, match="Did you mean 'gain'"):
        baselines.make(path, "zhang3-helix", gian=0.5)
    with pytest.raises(InvalidInputError, match=r"no attribute 'Damped' of .*"):
        baselines.get(f"{DampedLeastSquares.__module__}:Damped")


def test_packages_of_others_bring_policies(entry_points):
    entry_points(theirs=f"{__name__}:Still", extra=f"{__name__}:Misnamed [fast]", dls=f"{__name__}:Still")
    assert baselines.names()[-2:] == ("theirs", "extra")
    assert baselines.get("theirs").__name__ == "Still"
    assert evaluate("zhang3-helix", "theirs", steps=2)[0].policy == "theirs"
    assert baselines.get("extra").__name__ == "Misnamed"
    assert baselines.get("dls") is DampedLeastSquares  # names of ours take precedence


def test_a_bad_entry_point_takes_nobody_else_away(entry_points):
    entry_points(broken="not_installed.module:Policy", nonsense="::", theirs=f"{__name__}:Still")
    assert baselines.names()[-3:] == ("broken", "nonsense", "theirs")
    assert baselines.get("theirs").__name__ == "Still"
    with pytest.raises(InvalidInputError, match="No module named 'not_installed'"):
        baselines.get("broken")
    with pytest.raises(InvalidInputError, match=r"expected 'package\.module:attribute', got '::'"):
        evaluate("zhang3-helix", "nonsense", steps=2)
    plan = planned("zhang3-helix", "all", steps=2)
    assert {"dls", "theirs"} <= {job.policy for job in plan.jobs}
    reasons = {one.policy: one.reason for one in plan.skipped}
    assert "No module named 'not_installed'" in reasons["broken"]
    assert "expected 'package.module:attribute'" in reasons["nonsense"]
