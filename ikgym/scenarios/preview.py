"""Previews: the steps ahead at which the nominal coordinates are shown."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np

from ikgym.exceptions import InvalidInputError
from ikgym.validation import whole_number

#: An int p shows the steps 1 … p ahead, a sequence only those it contains.
Preview = int | Sequence[int]

# A longer preview would fill the memory.
FARTHEST = 1_000_000


def offsets(preview: Preview) -> tuple[int, ...]:
    """The steps ahead that a preview shows.

    Args:
        preview: An int p for 1 … p, or a sequence of steps ahead.
    """
    if isinstance(preview, (tuple, list)) and preview:
        ahead = tuple(preview)
        rising = all(map(_is_whole, ahead)) and all(a < b for a, b in itertools.pairwise(ahead))
        if rising and ahead[0] >= 1 and ahead[-1] <= FARTHEST:
            return tuple(int(step) for step in ahead)
    elif _is_whole(preview) and 1 <= preview <= FARTHEST:  # type: ignore[operator]  # a whole number
        return tuple(range(1, preview + 1))  # type: ignore[operator]
    raise InvalidInputError(
        "preview: expected a whole number of at least 1, or rising steps ahead such as (1, 10, 40), none above "
        f"{FARTHEST}, got {preview!r}."
    )


def furthest(preview: Preview) -> int:
    """Number of steps that a preview looks ahead."""
    steps: list[Any] = list(preview) if isinstance(preview, (tuple, list)) else [preview]
    return max((whole_number("preview", step, at_least=0) for step in steps), default=0)


def _is_whole(value: object) -> bool:
    return isinstance(value, (int, np.integer)) and not isinstance(value, bool)
