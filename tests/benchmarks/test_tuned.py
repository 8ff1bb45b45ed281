"""The search of settings beside published ones: with as many episodes, and judged on others."""

import dataclasses

import pytest

from baselines.evaluation.pages import sets, tuning
from baselines.evaluation.pages.tuning import Tuning
from baselines.tuning import solvers
from benchmarks import tuned
from ikgym.exceptions import UnknownNameError


def test_both_are_judged_on_episodes_that_neither_has_seen(tmp_path, monkeypatch):
    real, seen = solvers.Cost.costs, []

    def spy(self, settings, seeds):
        seen.extend(seeds)
        return real(self, settings, seeds)

    monkeypatch.setattr(solvers.Cost, "costs", spy)
    monkeypatch.setattr(tuned, "OTHERS", 2)
    published = Tuning.load(tuning.file_of(sets.SKEW))
    (dls,) = (one for one in published.solvers if one.spec == "dls")
    published = dataclasses.replace(published, episodes=1, solvers=(dataclasses.replace(dls, tried=3),))
    *_, line = tuned.compared(tuned.Command(out=tmp_path), published)
    assert line.startswith("| `dls` | 3 | 3 | 3 | 1.985e5 |")
    first = 1_000_000
    assert seen == [first] * 3 + [first + 1, first + 2] * 2
    with pytest.raises(UnknownNameError, match="Did you mean 'dls'"):
        tuned.compared(tuned.Command(out=tmp_path, policies=("dsl",)), published)
