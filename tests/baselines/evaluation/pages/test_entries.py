"""Who is entered: all solvers, as they are and tuned, and agents from their folders."""

import pytest

from baselines import registry
from baselines.agents.policy import LearnedPolicy
from baselines.agents.shipped import ShippedAgent
from baselines.evaluation.pages import entries, sets, tuning
from baselines.evaluation.pages.entries import FOR_OTHER_ARMS, Training, agents, solvers
from baselines.files import ResultsError
from baselines.spec import parse_policy
from ikgym.exceptions import InvalidInputError
from tests.baselines.evaluation.pages.builders import write_runs


class TestEntries:
    def test_everybody_is_there_once(self):
        names = [entry.label for entry in solvers(tuning.of(sets.SKEW).settings)]
        assert len(set(names)) == len(names)
        there = {parse_policy(entry.name)[0] for entry in solvers()}
        assert there == {
            name
            for name in registry.names()
            if not (registry.get(name).reference or registry.get(name).rival)
            and not issubclass(registry.get(name), LearnedPolicy)
        } - {"mfac_helix", "mfapc_helix", "mfapc_line", *FOR_OTHER_ARMS}
        assert {"rhc:horizon=3", "rhc:horizon=3,iterations=1", "rhc:horizon=200,iterations=1,move_blocks=27"} <= set(
            names
        )

    @pytest.mark.parametrize(
        ("name", "expected"),
        [
            ("dls", "dls"),
            ("rhc:horizon=3", "rhc:horizon=3"),
            ("full_orientation", "full_orientation"),
            ("full_orientation:policy=mfac", "full_orientation mfac"),
            (
                "full_orientation:policy=rhc,options={'horizon': 3, 'iterations': 1}",
                "full_orientation rhc:horizon=3,iterations=1",
            ),
        ],
    )
    def test_short_names(self, name, expected):
        assert entries.short(name) == expected

    def test_tuned_is_another_line(self):
        better = solvers({"dls": {"gain": 0.5}, "mfac": {}})
        assert [e.label for e in better if e.name in ("dls", "mfac")] == ["dls", "mfac", "dls, tuned"]
        assert better[-1].variants == (("dls", {"gain": 0.5}),)
        assert better[-1].general

    def test_shipped_agents_have_the_one_seed_that_was_kept(self):
        found = {entry.name: entry for entry in entries.shipped()}
        assert set(found) == {name for name in registry.names() if issubclass(registry.get(name), ShippedAgent)}
        alone, residual = found["agent_alone"], found["agent_residual"]
        assert (found["agent_ppo"].training.method, found["agent_ppo"].training.base_policy) == ("ppo", None)
        assert (alone.training.method, alone.training.base_policy, alone.seeds) == ("apg", None, (0,))
        assert residual.training.base_policy == "rhc:horizon=400,iterations=1,move_blocks=30"
        assert residual.training.steps == (256_000,)

    def test_the_preset_that_draws_has_seeds(self):
        (found,) = [entry for entry in solvers() if entry.name == entries.FORESIGHT]
        assert [parameters["seed"] for _, parameters in found.variants] == list(found.seeds) == [0, 1, 2]

    def test_an_agent_is_a_folder_of_seeds(self, tmp_path):
        write_runs(tmp_path, 3)
        (tmp_path / "seed-2" / "agent.safetensors").touch()
        with pytest.raises(ResultsError, match=r"seed-0.agent\.safetensors is missing"):
            agents([f"mine={tmp_path}"])
        for seed in range(3):
            (tmp_path / f"seed-{seed}" / "agent.safetensors").touch()
        (found,) = agents([f"mine={tmp_path}"])
        assert found.variants[2] == ("agent", {"path": str(tmp_path / "seed-2" / "agent.safetensors")})
        assert found.seeds == (0, 1, 2)
        assert found.training == Training("ppo", None, (100, 101, 102), (0.5, 0.5, 0.5))

    def test_what_is_no_agent(self, tmp_path):
        for text, message in {
            "mine": "NAME=DIR",
            f"dls={tmp_path}": "'dls' is taken",
            f"mine={tmp_path}": "expected folders seed-0",
        }.items():
            with pytest.raises((InvalidInputError, ResultsError), match=message):
                agents([text])
        write_runs(tmp_path, 1, method="ppo")
        (tmp_path / "seed-0" / "agent.safetensors").touch()
        (tmp_path / "seed-0" / "run.json").write_text("{}")
        with pytest.raises(ResultsError, match=r"run\.json"):
            agents([f"mine={tmp_path}"])

    def test_seeds_of_different_trainings(self, tmp_path):
        write_runs(tmp_path, 1, base_policy="dls")
        write_runs(tmp_path, 1, first=1)
        with pytest.raises(ResultsError, match="expected seeds of one training"):
            agents([f"mine={tmp_path}"])
