"""Analytic policy gradient: its gradient is that of its loss, and it learns."""

import numpy as np
import pytest
import torch

from baselines.agents.bilinear.processing import Bilinear
from baselines.training.gradients.arms import Arms
from baselines.training.gradients.law import Law
from baselines.training.run import policy_of, validate
from ikgym import Plant, scenarios
from ikgym.exceptions import InvalidInputError
from tests.baselines.training.small import tiny, trainer_of

CONFIG = tiny()


def test_gradient_of_a_window_is_that_of_its_loss():
    """Along a direction in the space of weights, against central differences: through arm, law and network.

    Features are seen once, where they have no gradient to miss.
    """
    # So long a prior makes the weights of the costs constant; they are not differentiated.
    many = {"max_gradient_share": 1e9, "cost_prior_steps": 1e12, "reset_distance": 1e9}
    config = CONFIG.replace(
        hidden=(16,), n_envs=6, activation="tanh", segment_steps=24, window=(24,), hold=24, damping=4e-2, **many
    )
    losses, slope = {}, 0.0
    for along in (0.0, 1e-6, -1e-6):
        trainer = trainer_of(config)
        actor = trainer._actor.double()  # in single precision features are rounded by more than what is looked for
        parameters, generator = list(actor.parameters()), torch.Generator().manual_seed(5)
        direction = [torch.randn(parameter.shape, generator=generator).double() for parameter in parameters]
        with torch.no_grad():
            for parameter, part in zip(parameters, direction, strict=True):
                parameter.add_(part, alpha=0.02 + along)
        loss, lost = trainer.window(24, np.random.default_rng(0))
        losses[along] = loss.item()
        assert lost == 0
        if along == 0.0:
            gradients = torch.autograd.grad(loss, parameters)
            slope = sum((g * part).sum().item() for g, part in zip(gradients, direction, strict=True))
    assert slope == pytest.approx((losses[1e-6] - losses[-1e-6]) / 2e-6, rel=1e-3)


def test_costs_are_weighted_by_those_of_their_episode():
    """Their gradient is that of the logarithm of the cost of the whole episode, the prior included."""
    arms = Arms(CONFIG.make_scenario(), 3, (1, 2, 10), 8)
    arms.usual, arms.spent[:], arms.played[:] = np.array([1.0, 2.0, 3.0]), [5.0, 0.0, 90.0], [10.0, 0.0, 30.0]
    costs = torch.tensor([[4.0, 1.0, 0.5], [0.1, 7.0, 40.0]], dtype=torch.float64, requires_grad=True)
    for cost in costs:
        arms.advance(np.array([8, 8, 8]), cost)
    arms.relative(costs.sum(0), prior=20.0).sum().backward()
    before = torch.tensor([5.0, 0.0, 90.0]) + 20.0 * torch.from_numpy(arms.usual)
    steps = torch.tensor([46.0, 36.0, 66.0], dtype=torch.float64)
    again = costs.detach().requires_grad_()
    (steps * (before + again.sum(0)).log()).sum().backward()
    torch.testing.assert_close(costs.grad, again.grad)


def test_episodes_that_end_in_a_window_are_weighted_separately(monkeypatch):
    config = CONFIG.replace(reset_distance=1e9, reset_distance_end=1e9)
    trainer, advance, seen = trainer_of(config), Arms.advance, []

    def recorded(arms, steps, cost):
        advance(arms, steps, cost)
        mean = (arms.spent + config.cost_prior_steps * arms.usual) / (arms.played + config.cost_prior_steps)
        seen.append((arms.seed.copy(), cost.detach().numpy(), mean))

    monkeypatch.setattr(Arms, "advance", recorded)
    loss, _ = trainer.window(48, np.random.default_rng(0))
    wanted, episodes = 0.0, 0
    for row in range(config.n_envs):
        spent = {}  # by episode: its cost in the window, and its mean stage cost then
        for seeds, costs, mean in seen:
            spent[seeds[row]] = spent.get(seeds[row], (0.0,))[0] + costs[row], mean[row]
        wanted += sum(cost / mean for cost, mean in spent.values())
        episodes += len(spent)
    assert episodes > config.n_envs
    assert loss.item() == pytest.approx(wanted / (config.n_envs * 48), rel=1e-12)


def test_it_learns():
    """From a damping that hardly lets it move: a gradient of the wrong sign, or none, stays at 1e7."""
    short = {"steps": 60, "segments": 4, "segment_steps": 240, "window": (16, 48)}
    config = CONFIG.replace(hidden=(32, 32), n_envs=32, averaging=0.9, damping=100.0, **short)
    trainer, scenario = trainer_of(config), config.make_scenario()
    before = validate(policy_of(trainer.agent(), scenario), scenario, 8)["cost"]
    losses = [metrics["train/loss"] for metrics in map(trainer.segment, range(4))]
    assert validate(policy_of(trainer.agent(), scenario), scenario, 8)["cost"] < 2e-2 * before
    assert losses[-1] < losses[0]


def test_lost_arms_are_put_back_on_their_path():
    """Where the reference joint path is then, with their costs so far forgotten; the others continue."""
    trainer = trainer_of(CONFIG)
    trainer.window(16, np.random.default_rng(0))
    arms, steps, spent = trainer._arms, trainer._arms.made.copy(), trainer._arms.spent.copy()
    trainer._far[:] = [0.0, 0.31, 0.29, 5.0]
    q = arms.q.detach().numpy().copy()
    assert trainer._renew(np.random.default_rng(1)) == 2
    scenario = trainer._scenario
    for row, lost in enumerate([False, True, False, True]):
        path = scenario.nominal_joint_path(int(arms.seed[row]))
        assert (arms.spent[row] == 0.0) == lost
        np.testing.assert_array_equal(arms.q[row].detach(), path[arms.made[row]] if lost else q[row])
        speed = (path[arms.made[row]] - path[arms.made[row] - 1]) / scenario.dt
        assert np.array_equal(arms.qdot[row].detach(), speed) == lost
    assert (arms.made == steps).all()
    assert spent.all()
    assert set(arms.seed.tolist()) <= set(scenarios.SPLITS["train"])


def test_the_agent_is_the_average_of_the_actor():
    trainer = trainer_of(CONFIG.replace(segments=5, averaging=0.7, segment_steps=16, window=(16,)))
    mean = [weights.detach().clone() for weights in trainer.policy.parameters()]
    for number in range(5):
        trainer.segment(number)
        kept = min(0.7, (1 + number) / (10 + number))
        mean = [kept * old + (1 - kept) * new for old, new in zip(mean, trainer._actor.parameters(), strict=True)]
        for wanted, given in zip(mean, trainer.policy.parameters(), strict=True):
            np.testing.assert_allclose(given.detach(), wanted.detach(), rtol=1e-5, atol=1e-7)


@pytest.mark.parametrize("name", ["tiago-line", "khan8-q7q8", "panda-glue"])
def test_other_arms_and_tasks(name):
    """Limits, a prismatic joint 1, points that are held, and references without a joint path."""
    trainer = trainer_of(CONFIG.replace(scenario=name, segments=1))
    metrics = trainer.segment(0)
    assert metrics["train/refused"] == 0.0
    assert np.isfinite(metrics["train/loss"])


def test_scenarios_that_cannot_be_differentiated_are_refused():
    noisy = scenarios.get("varga7-random").replace(plant=Plant(noise=0.1))
    with pytest.raises(InvalidInputError, match="expected an ideal plant"):
        Law(noisy, Bilinear())
    with pytest.raises(InvalidInputError, match="first pose"):
        Law(scenarios.get("zhang3-helix"), Bilinear())
