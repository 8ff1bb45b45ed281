"""The search of settings on validation episodes, and its file."""

import dataclasses
import json

import numpy as np
import pytest

from baselines import registry
from baselines.evaluate import evaluate
from baselines.evaluation.pages import entries, sets
from baselines.evaluation.pages.tuning import DATA, EPISODES, Tuned, Tuning, file_of, of, suiting, tune, update
from baselines.evaluation.pages.tuning.grids import GRIDS, decades, product
from baselines.files import ResultsError
from baselines.spec import parse_policy
from ikgym import scenarios
from ikgym.exceptions import InvalidInputError
from tests.baselines.evaluation.pages.builders import TEST_SEEDS

SEARCHED = sorted(file.stem for file in DATA.glob("*.json"))
MAIN = scenarios.get(sets.MAIN)
GRID = {"dls": (product(gain=(0.5, 1.0), damping=(1e-2,)), product(gain=(0.7,)))}


@pytest.fixture(scope="module")
def found():
    return tune("a command", "2000-01-01", MAIN, grids=GRID, episodes=2)


class TestTuning:
    def test_it_is_the_lowest_cost_of_what_was_tried(self, found):
        (one,) = found.solvers
        tried = [{}, {"gain": 0.5, "damping": 1e-2}, {"gain": 1.0, "damping": 1e-2}, {"gain": 0.7, "damping": 1e-2}]
        rows = evaluate(sets.MAIN, [("dls", settings) for settings in tried], episodes=2, split="validation")
        costs = np.exp(np.log([row.total_cost for row in rows]).reshape(4, 2).mean(axis=1))
        assert one.settings == tried[int(costs.argmin())]
        assert (one.tried, one.default, one.tuned) == (4, pytest.approx(costs[0]), pytest.approx(costs.min()))

    def test_a_stage_starts_from_the_best_of_the_one_before(self, monkeypatch):
        def bowl(_, trials, *args, **options):
            wanted = {"damping": 1e-2, "gain": 0.7}
            return [1.0 + sum(trial.settings.get(n, 9.0) != value for n, value in wanted.items()) for trial in trials]

        monkeypatch.setattr("baselines.evaluation.pages.tuning._costs", bowl)
        stages = (product(damping=(1e-3, 1e-2, 1e-1)), (), product(gain=(0.5, 0.7)))
        (one,) = tune("a", "b", MAIN, grids={"dls": stages}).solvers
        assert one == Tuned("dls", {"damping": 1e-2, "gain": 0.7}, 6, 3.0, 1.0)

    def test_no_test_episode_is_played(self, monkeypatch):
        seen = []

        def spy(jobs, **_):
            seen.extend(job.seed for job in jobs)
            raise KeyboardInterrupt

        monkeypatch.setattr("baselines.evaluation.pages.measure.run", spy)
        with pytest.raises(KeyboardInterrupt):
            tune("a command", "2000-01-01", MAIN, grids=GRID, episodes=EPISODES)
        assert len(set(seen)) == EPISODES
        assert set(seen) <= set(scenarios.SPLITS["validation"])
        assert not set(seen) & set(scenarios.SPLITS["test"])

    def test_nothing_better_is_no_setting(self):
        found = tune("a", "b", MAIN, grids={"dls": (product(damping=(1e3,)),)}, episodes=1)
        assert found.solvers[0].settings == {}
        assert found.solvers[0].tuned == found.solvers[0].default

    def test_a_file_is_read_as_it_was_written(self, found, tmp_path):
        found.save(tmp_path / "it.json")
        assert Tuning.load(tmp_path / "it.json") == found

    def test_what_is_refused(self, found, tmp_path):
        file = tmp_path / "it.json"
        for text in ("", "[]", '{"solvers": []}'):
            file.write_text(text)
            with pytest.raises(ResultsError, match=r"it\.json"):
                Tuning.load(file)
        dataclasses.replace(found, fingerprint="0" * 12).save(file)
        with pytest.raises(ResultsError, match="changed since"):
            Tuning.load(file)
        with pytest.raises(InvalidInputError, match="split 'test'"):
            dataclasses.replace(found, split="test")

    def test_grids_look_no_further(self):
        assert decades(-2, 0) == (0.01, 0.032, 0.1, 0.32, 1.0)
        scenario = scenarios.get(sets.SKEW)
        for spec, stages in GRIDS.items():
            name, parameters = parse_policy(spec)
            ahead = registry.make(name, scenario, **parameters).preview
            assert ahead <= entries.PAPER
            for settings in stages[0]:
                assert registry.make(name, scenario, **{**parameters, **settings}).preview == ahead

    def test_some_solvers_suit_skew_coordinates_alone(self):
        assert {*suiting(scenarios.get(sets.SKEW), GRIDS)} == {*GRIDS}
        assert {spec for spec in GRIDS if "full_orientation" in spec} == {*GRIDS} - {*suiting(MAIN, GRIDS)}

    def test_where_nothing_was_searched_there_are_none(self):
        assert of("varga7-fast").settings == {}

    @pytest.mark.parametrize("name", SEARCHED)
    def test_the_files_in_the_tree(self, name):
        there = Tuning.load(file_of(name))
        assert (there.scenario, there.split) == (name, "validation")
        assert there.episodes >= 16
        assert set(there.seeds) <= set(scenarios.SPLITS["validation"])
        assert not set(there.seeds) & set(TEST_SEEDS)
        assert {one.spec for one in there.solvers} == {*suiting(scenarios.get(name), GRIDS)}, f"stale: {update(name)}"
        assert all(one.tuned <= one.default for one in there.solvers)

    def test_a_part_of_it_tuned_again(self):
        there = Tuning.load(file_of(sets.SKEW))
        (then,) = [one for one in there.solvers if one.spec == "dls"]
        rows = evaluate(there.scenario, [then.variant], episodes=there.episodes, split="validation")
        assert np.exp(np.log([row.total_cost for row in rows]).mean()) == pytest.approx(then.tuned, rel=1e-4)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"settings": {"path": "x.zip", "trust": True}, "spec": "agent"}, "trust is given on the command line"),
        ({"spec": "agent:path=x.zip,trust=True", "settings": {}}, "trust is given on the command line"),
        ({"tried": "many"}, "the key 'tried' should have a value of type int, got 'many'"),
        ({"spec": 3}, "the key 'spec' should have a value of type str, got 3"),
        ({"spec": "nobody"}, "There is no policy 'nobody'"),
    ],
)
def test_settings_that_are_none_or_ask_for_trust(tmp_path, changes, message):
    content = json.loads(file_of(sets.SKEW).read_text(encoding="utf-8"))
    content["solvers"][0] |= changes
    (tmp_path / "tuned.json").write_text(json.dumps(content))
    with pytest.raises(ResultsError, match=rf"Cannot read settings from .*{message}"):
        Tuning.load(tmp_path / "tuned.json")
