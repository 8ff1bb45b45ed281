"""The file of the settings that were searched on validation episodes."""

import dataclasses
import json

import numpy as np
import pytest

from baselines.evaluate import evaluate
from baselines.evaluation import test_sets
from baselines.files import ResultsError
from baselines.tuning.settings import DATA, Tuning, file_of, of, update
from baselines.tuning.solvers import stated, suiting
from ikgym import scenarios
from ikgym.exceptions import InvalidInputError

SKEW = "varga7-random"
TEST_SEEDS = test_sets.get("varga7-pose-random").seeds

SEARCHED = sorted(file.stem for file in DATA.glob("*.json"))


@pytest.fixture(scope="module")
def found():
    return Tuning.load(file_of(SKEW))


class TestTuning:
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

    def test_where_nothing_was_searched_there_are_none(self):
        assert of("varga7-fast").settings == {}

    @pytest.mark.parametrize("name", SEARCHED)
    def test_the_files_in_the_tree(self, name):
        there = Tuning.load(file_of(name))
        assert (there.scenario, there.split) == (name, "validation")
        assert there.episodes >= 16
        assert set(there.seeds) <= set(scenarios.SPLITS["validation"])
        assert not set(there.seeds) & set(TEST_SEEDS)
        assert {one.spec for one in there.solvers} == {*suiting(scenarios.get(name), stated())}, update(name)
        assert all(one.tuned <= one.default for one in there.solvers)

    def test_a_part_of_it_tuned_again(self):
        there = Tuning.load(file_of(SKEW))
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
    content = json.loads(file_of(SKEW).read_text(encoding="utf-8"))
    content["solvers"][0] |= changes
    (tmp_path / "tuned.json").write_text(json.dumps(content))
    with pytest.raises(ResultsError, match=rf"Cannot read settings from .*{message}"):
        Tuning.load(tmp_path / "tuned.json")
