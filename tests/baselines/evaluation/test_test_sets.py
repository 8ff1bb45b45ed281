import pytest
from numpy.testing import assert_allclose

from baselines.evaluate import evaluate
from baselines.evaluation import test_sets
from baselines.fingerprints import set_hash
from ikgym import scenarios
from ikgym.exceptions import InvalidInputError
from ikgym.kernels import cost as cost_kernels
from tests.baselines.evaluation.planning import planned


@pytest.mark.parametrize("name", test_sets.names())
def test_the_sets_are_what_they_were(name):
    one = test_sets.SETS[name]
    assert set_hash(one.scenario, one.seeds) == one.digest, "what is meant to differ needs a new set"
    assert test_sets.get(name) is one


@pytest.mark.parametrize(
    ("name", "seed", "last"),
    [
        ("varga7-pose-random", 2_000_063, (0.409194226944, -0.488632498827, 0.058888695021, -0.4727872721)),
        ("varga7-random", 2_000_000, (0.331915028534, 0.437288000971, 0.46396646241, -0.218935014377)),
        ("panda-random", 2_000_127, (0.782552705425, -1.422801591503, 0.798453720653, -2.931062047715)),
    ],
)
def test_seeds_draw_what_they_drew(name, seed, last):
    """As numbers, for other machines than those of the digests."""
    assert seed in test_sets.SETS[name].seeds
    assert_allclose(scenarios.get(name).nominal_joint_path(seed)[-1, :4], last, rtol=0, atol=1e-9)


@pytest.mark.parametrize("drift", ["scenario", "cost", "seeds"])
def test_a_set_that_has_drifted_is_refused(monkeypatch, drift):
    if drift == "scenario":
        changed = scenarios.get("varga7-random").replace(dt=2e-3)
        monkeypatch.setattr(scenarios, "get", lambda name: changed)
    elif drift == "cost":
        monkeypatch.setattr(cost_kernels, "COST_VERSION", 0)
    else:
        monkeypatch.setitem(scenarios.SPLITS, "test", range(2_000_001, 3_000_000))
    with pytest.raises(InvalidInputError, match="'varga7-random' has changed"):
        evaluate(test_sets="varga7-random", policies="dls")


def test_a_frozen_set_is_played_as_it_is():
    jobs = planned((), "dls", test_sets="varga7-random").jobs
    assert [job.seeds.seed for job in jobs] == list(range(2_000_000, 2_000_064))
    assert {(job.scenario.name, job.scenario.steps, job.test_set) for job in jobs} == {
        ("varga7-random", 1000, test_sets.SETS["varga7-random"].digest)
    }
    assert all(job.test_set is None for job in planned("varga7-random", "dls").jobs)
