"""Registries of arms and scenarios: a bad registration affects no other member."""

import pytest

import ikgym
from ikgym import arms, scenarios
from ikgym.exceptions import InvalidInputError, UnknownNameError

pytestmark = pytest.mark.usefixtures("own_registries")
both = pytest.mark.parametrize("module", [arms, scenarios])


@both
def test_members_are_made_once_under_their_own_names(module):
    for name in module.names():
        assert module.get(name) is module.get(name)
        assert module.get(name).name == name


@both
def test_an_unknown_name_is_answered_with_the_nearest_and_all_others(module):
    near = module.names()[0]
    with pytest.raises(UnknownNameError, match=rf"'{near}x'\. Did you mean '{near}'\?") as caught:
        module.get(f"{near}x")
    assert all(name in str(caught.value) for name in module.names())
    with pytest.raises(UnknownNameError, match=r"There is no .* 7"):
        module.get(7)


@both
@pytest.mark.parametrize("name", [5, None, [], "", " "])
def test_a_name_that_is_no_text(module, name):
    with pytest.raises(InvalidInputError, match="expected a text as its name"):
        module.register(name, lambda: None)


def failing():
    raise KeyError("axes")


@both
@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: 3, r"'mine': expected its maker to give an object of (Arm|Scenario), got 3"),
        (lambda needed: needed, "'mine': making it failed: TypeError"),
        (failing, "'mine': making it failed: KeyError: 'axes'"),
    ],
)
def test_a_bad_function_breaks_no_other_lookup(module, make, message):
    others = module.names()
    with pytest.raises(InvalidInputError, match="expected a function without arguments that makes it"):
        module.register("mine", None)
    module.register("mine", make)
    for _ in range(2):  # a failure is not kept
        with pytest.raises(InvalidInputError, match=message):
            module.get("mine")
    assert all(module.get(name).name == name for name in others[:3])


def test_an_error_of_ours_stays_as_it_is():
    arms.register("mine", lambda: arms.get("varga8"))
    with pytest.raises(UnknownNameError, match="Did you mean 'varga7'"):
        arms.get("mine")


def test_scenarios_are_registered_under_their_names():
    mine = scenarios.get("varga7-fast").replace(name="mine", steps=3)
    scenarios.register(mine)
    assert scenarios.get("mine") is mine
    assert ikgym.RedundantIKEnv("mine").scenario.steps == 3
    with pytest.raises(InvalidInputError, match="scenario 'mine' is registered already"):
        scenarios.register(mine)
    with pytest.raises(InvalidInputError, match="make: expected none with the scenario 'new', got <function"):
        scenarios.register(mine.replace(name="new"), lambda: mine)
    with pytest.raises(UnknownNameError, match="There is no split"):
        scenarios.seeds(None, 1)
