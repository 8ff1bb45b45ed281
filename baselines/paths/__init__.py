"""Whether a path can be driven: start branches, the joint rates that they need, and the shortest time."""

from baselines.paths.retiming import Retimed, retime
from baselines.paths.survey import Branch, Survey, survey

__all__ = ["Branch", "Retimed", "Survey", "retime", "survey"]
