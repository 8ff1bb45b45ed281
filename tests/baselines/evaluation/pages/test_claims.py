"""The sentences of the leaderboard say what the numbers say."""

import numpy as np
import pytest

from baselines.evaluation.pages.claims import Comparison, sentences
from tests.baselines.evaluation.pages.builders import a_section, learned, line


class TestClaims:
    def test_an_agent_below_all(self):
        section = a_section(
            line("dls", ((4.0, 4.0),)),
            line("mfac", ((9.0, 4.0),)),
            line("rhc:horizon=100", ((1.0, 1.0),), preview=99),
            learned("residual", ((2.0, 2.0),) * 5, base_policy="dls"),
            learned("PPO", ((3.0, 3.0),) * 5),
            learned("lucky", ((1.5, 1.5),)),
        )
        text = "\n".join(sentences(section))
        assert "The best agent is residual (2.000, 2.000 to 2.000); it loses track in 0 of 10 runs." in text
        assert "It adds to `dls` and sees 240 steps ahead" in text
        assert "The best without a solver under it is PPO (3.000, 3.000 to 3.000)." in text
        assert "below all 2 solvers" in text
        assert (
            "its cost is 0.5000 (0.5000 to 0.5000) times that of the best of them, `dls` (4.000, 4.000 to 4.000)."
            in text
        )
        assert (
            "Its cost is 2.000 (2.000 to 2.000) times that of `rhc:horizon=100` (1.000, 1.000 to 1.000), which looks "
            "99 steps ahead." in text
        )
        assert (
            "The best solver that looks further, 99 steps ahead, is `rhc:horizon=100` (1.000, 1.000 to 1.000); it "
            "loses track in 0 of 2 runs." in text
        )
        assert "lucky" not in text

    def test_an_agent_that_is_not(self):
        section = a_section(
            line("dls", ((4.0, 4.0),)),
            line("dls", ((2.0, 2.0),), settings={"gain": 0.5}),
            learned("PPO", ((3.0, 3.0),), error=0.06),
        )
        text = "\n".join(sentences(section))
        assert "PPO (3.000, 3.000 to 3.000) (1 seed: not a benchmark); it loses track in 2 of 2 runs." in text
        assert "**not** below" in text
        assert "1 of 2 are as low or lower, namely `dls`, tuned (2.000, 2.000 to 2.000)" in text
        assert "1.500 (1.500 to 1.500)" in text

    def test_a_residual_agent_that_is_no_better_than_its_base_policy_makes_no_headline(self):
        """It has to be below it with its whole interval."""
        solvers = line("dls", ((4.0, 4.0),)), line("mfac", ((9.0, 4.0),))
        residual = learned("residual", ((4.4, 2.0),) * 5, base_policy="dls")
        text = "\n".join(sentences(a_section(*solvers, residual, learned("PPO", ((5.0, 5.0),) * 5))))
        assert "- residual (2.966, 2.000 to 4.400) corrects `dls` and costs 0.7416 (0.5000 to 1.100) times" in text
        assert "The best agent is PPO" in text
        assert "The best without a solver under it" not in text
        text = "\n".join(sentences(a_section(*solvers, residual)))
        assert "No agent is better than the solver that it corrects, and none stands alone." in text

    def test_no_agent(self):
        text = "\n".join(sentences(a_section(line("dls"), line("mfac", ((1.0, 1.0),)))))
        assert "No agent has been entered" in text
        assert "paper's horizon is `mfac` (1.000, 1.000 to 1.000)" in text

    def test_who_has_played_fewer_is_compared_on_those(self):
        one, other = np.array([[4.0, 9.0, 100.0]]), np.array([[2.0, 3.0]])
        assert Comparison.of(one, other).ratio == pytest.approx(6.0**0.5)
        assert Comparison.of(other, one).ratio == pytest.approx(6.0**-0.5)

    def test_a_comparison_is_by_episodes(self):
        """Episodes that are hard for both say nothing of their ratio."""
        hard = np.exp(np.random.default_rng(1).normal(size=(1, 30)))
        found = Comparison.of(np.tile(2.0 * hard, (3, 1)), np.vstack([0.5 * hard, 2.0 * hard]))
        assert (found.ratio, found.low, found.high) == pytest.approx((2.0, 2.0, 2.0))
