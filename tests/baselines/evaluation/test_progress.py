"""The line of progress while kernels are compiled."""

from __future__ import annotations

import logging

from baselines.evaluation.play import _Line
from tests.baselines.evaluation.planning import planned


class Bar:
    """What tqdm does, written down."""

    def __init__(self, disable=False):
        self.disable, self.descriptions, self.steps, self.written = disable, [], 0, []

    def set_description(self, text, refresh):
        self.descriptions.append(text)

    def update(self, steps):
        self.steps += steps

    def write(self, text, file):
        self.written.append(text)


def test_it_says_what_is_compiled_and_that_this_happens_once():
    bar = Bar()
    line = _Line(bar)
    (job,) = planned("varga7-fast", "dls").jobs
    line.announce(job, 1, 2)
    with line.watching():
        logging.getLogger("ikgym").warning("Compiling the policy dls; this happens once, the result is cached on disk.")
        assert bar.descriptions[-1] == "Compiling the policy dls; this happens once"
        line.tick(100)
        assert bar.descriptions[-1] == "varga7-fast · dls (1/2)"
        line.tick(100)
        assert len(bar.descriptions) == 3
        logging.getLogger("ikgym").warning("Something else.")
    logging.getLogger("ikgym").warning("Compiling what nobody plays; this happens once, you know.")
    assert bar.steps == 200
    assert bar.written == ["Something else."]
    assert bar.descriptions[-1] == "varga7-fast · dls (1/2)"
