"""PPO of agents with memory: its mean gradient is that of the costs of the estimates."""

import torch

from baselines.training.memory.filter import costs, loss
from baselines.training.memory.rewards import Exploring, Rollout, explored, surrogate
from tests.baselines.agents.recurrent.recurrent_agents import PROCESSING
from tests.baselines.training.memory.test_filter import measured, network

DELTA_X, FLOOR, STD = 1e-3, 0.13, 0.1


def rollout(one, shown, group_size, gamma=1.0):
    torch.manual_seed(3)
    return explored(one, PROCESSING, shown, DELTA_X, FLOOR, std=STD, group_size=group_size, gamma=gamma)


def gradient(value, one):
    return torch.cat([part.flatten() for part in torch.autograd.grad(value, list(one.parameters()))])


def test_the_gradient_points_where_that_through_the_filter_does():
    one, shown = network(), measured()
    analytic = gradient(loss(one, PROCESSING, shown, DELTA_X, FLOOR), one)
    estimated = gradient(surrogate(one, rollout(one, shown, 1500), STD, 0.2), one)
    assert torch.cosine_similarity(analytic, estimated, dim=0) > 0.9


def test_lost_measurements_have_no_gradient():
    """Noise at a lost measurement changes no cost, and has no part in the gradient."""
    one, shown = network(), measured()
    found = rollout(one, shown, 2)
    assert not found.arrived.all()
    other = found._replace(outputs=torch.where(found.arrived[:, :, None], found.outputs, 7.0))
    assert torch.equal(surrogate(one, found, STD, 0.2), surrogate(one, other, STD, 0.2))


def test_members_of_a_group_go_through_the_same_episode():
    one, shown = network(), measured()
    found, exploring = rollout(one, shown, 2, gamma=0.5), Exploring(one, 0.0)
    with torch.no_grad():
        wanted = costs(one, PROCESSING, shown, DELTA_X)
        assert torch.equal(costs(exploring, PROCESSING, shown, DELTA_X), wanted)  # without noise
    assert torch.equal(found.features[::2, 0], found.features[1::2, 0])
    assert not torch.equal(found.features[::2, -1], found.features[1::2, -1])
    torch.testing.assert_close(found.advantages[::2], -found.advantages[1::2])


def test_beyond_the_clip_range_there_is_no_gradient():
    one, shown = network(), measured()
    found = rollout(one, shown, 2)
    far = found._replace(log_prob=found.log_prob - 10.0, advantages=torch.ones_like(found.advantages))
    assert not gradient(surrogate(one, far, STD, 0.2), one).any()
    back = Rollout(*far[:-1], advantages=-far.advantages)
    assert gradient(surrogate(one, back, STD, 0.2), one).any()
