"""Registries of arms, scenarios and tasks: what is registered wrongly breaks nothing else."""

from __future__ import annotations

import pytest

import ikgym
from ikgym import arms, scenarios
from ikgym.exceptions import InvalidInputError, UnknownNameError


@pytest.fixture(autouse=True)
def own_registries(monkeypatch):
    for module in (arms, scenarios):
        monkeypatch.setattr(module._registry, "_makers", dict(module._registry._makers))
        monkeypatch.setattr(module._registry, "_made", dict(module._registry._made))


@pytest.mark.parametrize("module", [arms, scenarios])
@pytest.mark.parametrize("name", [5, None, [], "", " "])
def test_a_name_that_is_none(module, name):
    with pytest.raises(InvalidInputError, match="expected a text as its name"):
        module.register(name, lambda: None)
    assert len(module.names()) == len(set(module.names()))
    with pytest.raises(UnknownNameError):
        module.get("5")


@pytest.mark.parametrize("module", [arms, scenarios])
@pytest.mark.parametrize("make", [None, 3, "varga7"])
def test_a_maker_that_is_none(module, make):
    with pytest.raises(InvalidInputError, match="expected a function without arguments that makes it"):
        module.register("mine", make)
    assert "mine" not in module.names()


def failing():
    raise KeyError("axes")


@pytest.mark.parametrize("module", [arms, scenarios])
@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: 3, r"'mine': expected its maker to give an object of (Arm|Scenario), got 3"),
        (lambda: None, "expected its maker to give an object of"),
        (lambda needed: needed, "'mine': making it failed: TypeError"),
        (failing, "'mine': making it failed: KeyError: 'axes'"),
    ],
)
def test_a_maker_of_something_else_breaks_no_other_lookup(module, make, message):
    others = module.names()
    module.register("mine", make)
    for _ in range(2):  # a failure is not kept
        with pytest.raises(InvalidInputError, match=message):
            module.get("mine")
    assert module.names() == (*others, "mine")
    assert all(module.get(name).name == name for name in others)


def test_an_error_of_ours_in_a_maker_stays_what_it_is():
    arms.register("mine", lambda: arms.get("varga8"))
    with pytest.raises(UnknownNameError, match="Did you mean 'varga7'"):
        arms.get("mine")


@pytest.mark.parametrize("split", [[], {}, None, 3])
def test_a_split_that_is_no_text(split):
    with pytest.raises(UnknownNameError, match="There is no split"):
        ikgym.scenarios.seeds(split, 1)
