"""Which solver for an arm and a path: solvers are played, and one is recommended by a written rule."""

from baselines.evaluation.compare.playing import Comparison, compare
from baselines.evaluation.compare.rule import Recommendation, recommend

__all__ = ["Comparison", "Recommendation", "compare", "recommend"]
