"""The law in PyTorch is that of the agent, and its gradient that of central differences."""

import numpy as np
import pytest
import torch

from baselines.agents.bilinear.features import feature_rows, metric_rows
from baselines.agents.bilinear.kernels import LARGEST, gain_rows
from baselines.agents.bilinear.processing import Bilinear
from baselines.policy import Problem
from baselines.training.gradients.law import Law
from ikgym import scenarios, tasks
from tests.baselines.agents.bilinear.test_bilinear import OFFSETS, ROWS, batch_of

DAMPED = Bilinear(OFFSETS, 4e-3)
#: Whole poses, tasks of three and of six coordinates, and a prismatic joint 1.
CASES = [
    ("varga7-pose-random", "pose"),
    ("varga7-random", "position"),
    ("zhang6-lspb", "axis"),
    ("tiago-line", "matrix"),
]


@pytest.fixture(params=CASES, ids=str)
def case(request):
    """A law, its problem, observations, features and outputs of a network."""
    name, task = request.param
    scenario = scenarios.get(name).replace(task=tasks.get(task))
    law, problem = Law(scenario, DAMPED), Problem.of(scenario)
    batch = batch_of(problem)
    q = torch.from_numpy(batch.q).requires_grad_()
    seen, speed = law.features(q, batch.nominal, batch.remaining)
    output = torch.from_numpy(np.random.default_rng(1).normal(scale=0.5, size=(ROWS, law.outputs)))
    return law, problem, batch, (q, seen, output.requires_grad_()), speed


def test_it_is_the_law_of_the_agent(case):
    law, problem, batch, (q, seen, output), speed = case
    features, speeds, kind, chain = np.empty(seen.shape), np.empty(ROWS), problem.task.kind, problem.model.chain
    feature_rows(kind, chain, problem.dt, np.array(OFFSETS), batch.q, batch.nominal, batch.remaining, features, speeds)
    np.testing.assert_array_equal(seen, features)
    np.testing.assert_array_equal(speed, speeds)
    assert not seen.requires_grad
    given, wanted = output.detach().numpy().copy(), np.empty((ROWS, DAMPED.held_size(problem)))
    metric_rows(kind, chain.prismatic, len(OFFSETS) - 1, features, given)
    gain_rows(kind, chain, DAMPED.damping, batch.q, given, wanted)
    np.testing.assert_allclose(law.gains(q, seen, output).detach(), wanted, rtol=1e-9, atol=1e-9)


def test_gradients(case):
    law, _, _, (q, seen, output), _ = case
    assert torch.autograd.gradcheck(lambda q, output: law.gains(q, seen, output), (q, output), atol=1e-5, rtol=1e-4)


def test_what_is_cut_has_no_gradient(case):
    law, problem, _, (q, seen, output), _ = case
    n = problem.model.joints
    far = output.detach().clone()
    far[:, -1 - n :] = 10.0 * LARGEST
    law.gains(q, seen, far.requires_grad_()).sum().backward()
    assert not far.grad[:, -1 - n :].any()
    assert torch.isfinite(q.grad).all()
