"""Who is compared on the cost–time page: all that can be chosen, and the families by horizon."""

import pytest

import baselines
from baselines import registry
from baselines.agents.policy import LearnedPolicy
from baselines.evaluation.pages.entries import FOR_OTHER_ARMS, SEEDS, solver
from baselines.evaluation.pages.families import (
    BLOCKS,
    HORIZONS,
    OPTIMUM,
    OPTIMUM_BLOCKS,
    REAL_TIME,
    blocks,
    entries,
    family,
)
from baselines.solvers.wrappers.full_orientation import FullOrientation
from baselines.spec import parse_policy


class TestEntries:
    def test_whoever_can_be_chosen_is_there(self):
        there = {parse_policy(c.name)[0] for c in entries()}
        # Agents, and what is shown other coordinates, are on the leaderboard.
        elsewhere = {
            name for name in baselines.names() if issubclass(registry.get(name), (LearnedPolicy, FullOrientation))
        }
        others = {"mfac_helix", "mfapc_helix", "mfapc_line", *FOR_OTHER_ARMS}
        rivals = {name for name in baselines.names() if registry.get(name).rival}  # have a page of their own
        ours = {name for name in baselines.names() if not registry.get(name).reference} - rivals
        assert there == ours - elsewhere - others

    def test_each_once(self):
        specs = [c.name for c in entries()]
        assert len(set(specs)) == len(specs)

    def test_families_have_all_horizons(self):
        members = [family(c.name) for c in entries() if family(c.name)]
        assert HORIZONS == (3, 5, 10, 30, 100, 200, 400)
        assert [horizon for kind, horizon in members if kind == REAL_TIME] == list(HORIZONS)
        assert [horizon for kind, horizon in members if kind == OPTIMUM] == [3, 5, 10, 30, 100]
        for name in (OPTIMUM_BLOCKS, BLOCKS):
            assert [horizon for kind, horizon in members if kind == name] == [30, 100, 200, 400]

    def test_who_takes_too_long_plays_fewer_episodes(self):
        fewer = {c.name for c in entries() if c.share < 1.0}
        assert fewer == {
            *(f"rhc:horizon={h}" for h in (100,)),
            *(f"rhc:horizon={h},move_blocks={blocks(h)}" for h in (100, 200, 400)),
            *(f"rhc:horizon={h},iterations=1" for h in (200, 400)),
        }

    @pytest.mark.parametrize(
        ("spec", "expected"),
        [
            ("rhc:horizon=30", (OPTIMUM, 30)),
            ("rhc:horizon=5,iterations=1", (REAL_TIME, 5)),
            ("rhc:horizon=400,iterations=1,move_blocks=30", (BLOCKS, 400)),
            ("rhc:horizon=400,move_blocks=30", (OPTIMUM_BLOCKS, 400)),
            ("rhc:horizon=30,starts=4", None),
            ("rhc", None),
            ("rhc_foresight:horizon=30", None),
            ("dls", None),
        ],
    )
    def test_family(self, spec, expected):
        assert family(spec) == expected

    @pytest.mark.parametrize(("horizon", "knots"), [(3, None), (10, None), (30, 17), (100, 23), (400, 30)])
    def test_blocks(self, horizon, knots):
        assert blocks(horizon) == knots

    def test_presets_that_draw_have_three_seeds_and_know_the_end_or_not(self):
        found = {c.name: c for c in entries() if c.name.startswith("rhc_foresight")}
        assert list(found) == ["rhc_foresight:stop_at_end=True", "rhc_foresight:stop_at_end=False"]
        for entry in found.values():
            assert entry.seeds == SEEDS == (0, 1, 2)
            assert entry.timed > 1
            assert [parameters["seed"] for _, parameters in entry.variants] == [0, 1, 2]
        assert solver("dls").variants == (("dls", {}),)
