"""What a method of training has to offer, so that a run of it can be evaluated, resumed and repeated."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

from baselines.agents.recurrent.processing import Recurrent
from baselines.training.config.base import Stored

if TYPE_CHECKING:  # the command line is read without it
    from stable_baselines3.common.base_class import BaseAlgorithm

    from baselines.training.networks import ActorModel, MemoryModel
    from baselines.training.score import Score

#: What a trainer says of a segment, by name.
SegmentMetrics = dict[str, float]


class Trainer(Protocol):
    """A run that goes on segment by segment.

    Before it is made and before each segment, :func:`randomness.reseed` has seeded the generators of Python,
    NumPy and PyTorch; what else is random comes from :func:`randomness.sequence`. A segment depends on
    nothing but :meth:`state` and its number: then a run that was killed at any moment, and is resumed from any
    earlier state, ends with the very weights of one that was not.

    Attributes:
        model: An ordinary model of Stable-Baselines3, or an actor alone, whose observations are the features of
            `processing`.
        processing: What the agent sees, and what the outputs of its network mean.
        segments: The number of segments.
        steps: Steps of the environment so far, those of all arms together.
    """

    model: BaseAlgorithm | ActorModel | MemoryModel
    processing: Stored | Recurrent
    segments: int

    @property
    def steps(self) -> int:
        """Steps of the environment so far, those of all arms together."""

    def segment(self, number: int) -> SegmentMetrics:
        """Trains for one segment.

        Args:
            number: Counted from 0.
        """

    def score(self, episodes: int) -> Score:
        """How good the model is on the first so many episodes of the validation split."""

    def state(self) -> dict[str, Any]:
        """All that the segments to come depend on: tensors, numbers, texts, and lists and dicts of them."""

    def restore(self, state: dict[str, Any]) -> None:
        """Goes on from a state.

        Args:
            state: What :meth:`state` gave, in this process or another.
        """
