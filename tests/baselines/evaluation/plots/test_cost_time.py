"""Cost, or cost ratio, against time per step: what the plots of an evaluation share with those of the pages."""

import dataclasses

import numpy as np
import pytest

from baselines.evaluate import evaluate
from baselines.evaluation.plots import cost_time, style
from baselines.evaluation.summary import Spread, summarise

NAME = "varga7-pose-random"


def test_it_is_drawn_where_it_is_known():
    (row,) = evaluate(NAME, "dls")
    for cost_ratio, label in ((1.5, "cost ratio [1]"), (None, "total cost [1]")):
        summaries = summarise([dataclasses.replace(row, cost_ratio=cost_ratio)])
        drawn = cost_time.draw("t", summaries, {id(summaries[0]): "dls"}, {id(summaries[0]): {"color": "k"}})
        assert drawn.axes[0].get_ylabel() == label


def test_its_axis_is_logarithmic_in_what_it_exceeds_1_by():
    axes = style.figure(3.0).subplots()
    values = [1.001, 1.01, 1.1, 2.0, 11.0]
    marks = [cost_time.Mark(10.0, Spread(value, value, value, value, 0), "x", "k") for value in values]
    cost_time.scatter(axes, marks, quantity=cost_time.COST_RATIO, several=False)
    places = axes.yaxis.get_transform().transform(values)
    assert np.diff(places) == pytest.approx(1.0)
    assert axes.yaxis.get_transform().inverted().transform(places) == pytest.approx(values)
    shown = [text.get_text() for text in axes.get_yticklabels()]
    assert {"1.001", "1.1", "2", "10"} <= set(shown)
