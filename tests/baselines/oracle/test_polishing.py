"""Best known costs of arms that are not those of the data sheet, from the optimum of the arm that is."""

import numpy as np
import pytest

import ikgym
from baselines.oracle import Search
from baselines.oracle.episode import EpisodeProblem
from baselines.oracle.search import polish, search
from ikgym.exceptions import InvalidInputError
from ikgym.plant import Plant

QUICK = Search(starts=12, generations=0, polished=2, knots=20)
SEED = 1_000_000
PLAIN = ikgym.scenarios.get("panda-ideal").replace(steps=60)


@pytest.fixture(scope="module")
def optimum():
    return search(PLAIN, SEED, QUICK)


def test_polishing_comes_to_what_the_search_finds(optimum):
    other = PLAIN.replace(arm=ikgym.arms.get("panda-3"), model=PLAIN.model)
    found, searched = polish(other, SEED, {"ideal": optimum.q}), search(other, SEED, QUICK)
    assert found.cost == pytest.approx(searched.cost, rel=1e-6)
    assert found.found_by == "ideal"
    assert found.cost > 2.0 * optimum.cost  # what the first error costs
    _, played = EpisodeProblem.of(other, SEED).play(optimum.qdot)
    assert found.cost < 0.5 * played


def test_a_payload_is_foreseen(optimum):
    """The arm gets ready for it: nothing that is played until then and optimal after it can be as cheap."""
    loaded = PLAIN.replace(plant=Plant(payload=1e-3, payload_step=30))
    found = polish(loaded, SEED, {"ideal": optimum.q})
    assert found.cost > optimum.cost
    assert not np.allclose(found.q[:29], optimum.q[:29], atol=1e-6)
    late = polish(PLAIN.replace(plant=Plant(payload=1e-3, payload_step=61)), SEED, {"ideal": optimum.q})
    assert late.cost == pytest.approx(optimum.cost, rel=1e-9)


@pytest.mark.parametrize("plant", [Plant(zero=1e-3), Plant(bandwidth=10.0)])
def test_of_a_plant_there_is_nothing_but_a_payload(plant):
    with pytest.raises(InvalidInputError, match="expected an ideal plant, except a payload"):
        EpisodeProblem.of(PLAIN.replace(plant=plant), SEED)
