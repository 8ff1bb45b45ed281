"""Imitation and analytic policy gradient: what a segment does follows from state and number, and it is learning."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from baselines.agents.bilinear.processing import Bilinear
from baselines.agents.files import load_agent, save_agent
from baselines.agents.network import Network
from baselines.episodes import play as play_episodes
from baselines.training.config.actor_only import APG, Imitate
from baselines.training.environment.view import View
from baselines.training.errors import TrainingError
from baselines.training.gradients.arms import Arms
from baselines.training.gradients.law import Law
from baselines.training.networks import ActorModel
from baselines.training.randomness import deterministic_torch
from baselines.training.run import train
from baselines.training.trainers.initial_weights import inherit
from baselines.training.trainers.models import ALGORITHMS, network_outputs, weights_hash
from baselines.training.trainers.students import student
from baselines.training.validation import play, validation_seeds
from ikgym import Plant, scenarios
from ikgym.exceptions import InvalidInputError, UnknownNameError
from ikgym.outcome import observation
from tests.baselines.training.segments import made, play_segments
from tests.baselines.training.small import TINY

SMALL = {name: TINY[name] for name in ("scenario", "steps", "hidden", "offsets", "segments", "n_envs")}
OVER = {**SMALL, "scenario": "varga7-random", "base_policy": "dls", "null_space": 1e-2}
POSE = {**SMALL, "scenario": "varga7-random", "task": "pose"}
BILINEAR = APG(
    **{**SMALL, "scenario": "varga7-random", "steps": 100}, task="pose", hold=8, segment_steps=48, window=(16, 48)
)
CONFIGS = {
    "apg": BILINEAR,
    "apg, damped": BILINEAR.replace(damping=4e-4),
    "apg, no matrix": BILINEAR.replace(damping=4e-4, matrix=False),
    "apg, predicted": BILINEAR.replace(damping=4e-4, predicted_rates=True),
    "apg, tail": BILINEAR.replace(steps=20, replay_share=0.5, singular_share=0.5, start_noise=0.01),
    "apg, skew, end within a segment": BILINEAR.replace(task="skew", steps=20),
    "imitate": Imitate(**SMALL, expert="dls", gradient_steps=5, batch_size=16, example_every=2, buffer_size=70),
    "imitate, bilinear": Imitate(**POSE, expert="dls", output="bilinear", gradient_steps=5, batch_size=16),
    "imitate, no matrix": Imitate(
        **POSE, expert="dls", output="bilinear", damping=1e-2, matrix=False, gradient_steps=5, batch_size=16
    ),
    "imitate over dls": Imitate(**OVER, expert="rhc:horizon=5", gradient_steps=5, batch_size=16, algorithm="sac"),
}


@pytest.fixture(autouse=True)
def one_thread():
    with deterministic_torch():
        yield


def cost(trainer, config, episodes=8):
    """Geometric mean over validation episodes."""
    scenario = config.make_scenario()
    seeds = validation_seeds(scenario, episodes)
    costs, *_ = play(lambda features: network_outputs(trainer.model, features), config.processing, scenario, seeds)
    return np.exp(np.log(costs).mean())


@pytest.mark.parametrize("config", CONFIGS.values(), ids=CONFIGS.keys())
def test_a_segment_follows_from_state_and_number(config, tmp_path):
    undisturbed = made(config)
    play_segments(undisturbed, [0])
    torch.save(undisturbed.state(), tmp_path / "state.pt")
    wanted = play_segments(undisturbed, [1, 2])

    other = made(config, seed=7)  # as if it were another one
    play_segments(other, [0], seed=7)
    other = made(config)
    other.restore(torch.load(tmp_path / "state.pt", weights_only=True))
    assert play_segments(other, [1, 2]) == wanted
    assert weights_hash(other.model) == weights_hash(undisturbed.model)
    assert other.steps == undisturbed.steps


@pytest.mark.parametrize("config", CONFIGS.values(), ids=CONFIGS.keys())
def test_ordinary_models_come_out(config):
    trainer = made(config)
    before = weights_hash(trainer.model)
    play_segments(trainer, [0])
    alone = isinstance(config.processing, Bilinear)
    assert type(trainer.model) is (ActorModel if alone else ALGORITHMS[config.algorithm])
    assert weights_hash(trainer.model) != before
    played = config.segment_steps if isinstance(config, APG) else config.steps
    assert trainer.steps == config.n_envs * played


@pytest.mark.parametrize(
    ("inverse", "hold"),
    [
        ({}, 8),
        ({"damping": 4e-2}, 8),
        ({"damping": 4e-2, "matrix": False}, 8),
        ({"damping": 4e-2, "predicted_rates": True}, 24),  # seen once, where it has no gradient to miss
    ],
    ids=str,
)
def test_gradient_of_a_window_is_that_of_its_loss(inverse, hold):
    """Along a direction in the space of weights, against central differences: through arm, features and network."""
    # So long a prior makes the weights of the costs constant; they are not differentiated.
    many = {"max_gradient_share": 1e9, "cost_prior_steps": 1e12, "reset_distance": 1e9}
    config = BILINEAR.replace(
        hidden=(16,), n_envs=6, activation="tanh", segment_steps=24, window=(24,), hold=hold, **inverse, **many
    )
    losses, slope = {}, 0.0
    for along in (0.0, 1e-6, -1e-6):
        trainer = made(config)
        trainer.actor.double()  # in single precision features are rounded by more than what is looked for
        parameters, generator = list(trainer.actor.parameters()), torch.Generator().manual_seed(5)
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


def test_costs_are_weighted_by_what_their_episode_has_cost_in_the_end():
    """Their gradient is that of the logarithm of all that the episode has cost, the prior included."""
    arms = Arms(BILINEAR.make_scenario(), 3, (1, 2, 10))
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


def test_episodes_that_end_in_a_window_are_weighted_each_by_its_own_costs(monkeypatch):
    config = BILINEAR.replace(reset_distance=1e9, reset_distance_end=1e9)
    trainer, advance, seen = made(config), Arms.advance, []

    def recorded(arms, steps, cost):
        advance(arms, steps, cost)
        mean = (arms.spent + config.cost_prior_steps * arms.usual) / (arms.played + config.cost_prior_steps)
        seen.append((arms.seed.copy(), cost.detach().numpy(), mean))

    monkeypatch.setattr(Arms, "advance", recorded)
    loss, _ = trainer.window(48, np.random.default_rng(0))
    wanted, episodes = 0.0, 0
    for row in range(config.n_envs):
        spent = {}  # by episode: what it has cost in the window, and its mean stage cost then
        for seeds, costs, mean in seen:
            spent[seeds[row]] = spent.get(seeds[row], (0.0,))[0] + costs[row], mean[row]
        wanted += sum(cost / mean for cost, mean in spent.values())
        episodes += len(spent)
    assert episodes > config.n_envs
    assert loss.item() == pytest.approx(wanted / (config.n_envs * 48), rel=1e-12)


def test_analytic_policy_gradient_learns():
    """From rest to within centimetres: a gradient of the wrong sign, or none, stays at 4e8."""
    config = BILINEAR.replace(
        steps=60, hidden=(32, 32), n_envs=32, segments=4, segment_steps=240, window=(16, 48), averaging=0.9
    )
    trainer = made(config)
    before = cost(trainer, config)
    losses = [metrics["train/loss"] for metrics in play_segments(trainer, range(4))]
    assert cost(trainer, config) < 2e-3 * before
    assert losses[-1] < losses[0]


def test_a_run_of_apg_repeats_and_goes_on(tmp_path):
    """Bit for bit from its configuration; its actor is what another run begins with."""
    results = [train(BILINEAR, 1, tmp_path / name) for name in ("one", "other")]
    assert len({result.weights_sha256 for result in results}) == 1
    files = {file.name for file in (tmp_path / "one").iterdir() if file.is_file()} - {".lock"}
    assert files == {"run.json", "history.json", "checkpoint.pt", "agent.safetensors"}
    agent = load_agent(tmp_path / "one" / "agent.safetensors")
    config = inherit(BILINEAR.replace(init=agent.source, hidden=(3,)), ())
    assert config.hidden == BILINEAR.hidden
    begun = made(config, seed=5)
    for layer, weights in zip(begun.model.policy[::2], agent.network.weights, strict=True):
        np.testing.assert_array_equal(layer.weight.detach(), weights)
    assert inherit(BILINEAR.replace(init=agent.source, damping=1e-3), ()).damping is None
    assert not inherit(BILINEAR.replace(init=agent.source, damping=1e-3, predicted_rates=True), ()).predicted_rates
    with pytest.raises(TrainingError, match="another structure than imitate trains"):
        inherit(Imitate(**SMALL, init=agent.source), ())
    with pytest.raises(TrainingError, match=r"offsets: .* has \(1, 2, 10\), got \(1, 5\)"):
        inherit(BILINEAR.replace(init=agent.source, offsets=(1, 5)), {"offsets"})


def test_lost_arms_are_put_back_on_their_path():
    """Where the reference joint path is then, and their costs so far forgotten; the others go on."""
    trainer = made(BILINEAR)
    trainer.window(16, np.random.default_rng(0))
    arms, made_before, spent = trainer._arms, trainer._arms.made.copy(), trainer._arms.spent.copy()
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
    assert (arms.made == made_before).all()
    assert spent.all()


def test_the_model_is_the_average_of_the_actor():
    trainer = made(BILINEAR.replace(segments=5, averaging=0.7, segment_steps=16, window=(16,)))
    mean = [weights.detach().clone() for weights in trainer.model.policy.parameters()]
    for number in range(5):
        play_segments(trainer, [number])
        kept = min(0.7, (1 + number) / (10 + number))
        mean = [kept * old + (1 - kept) * new for old, new in zip(mean, trainer._actor.parameters(), strict=True)]
        for wanted, given in zip(mean, trainer.model.policy.parameters(), strict=True):
            np.testing.assert_allclose(given.detach(), wanted.detach(), rtol=1e-5, atol=1e-7)


def test_windows_and_reset_distances_of_segments():
    config = BILINEAR.replace(segments=8, window=(16, 48), reset_distance=0.3, reset_distance_end=0.5)
    assert [config.window_of(number) for number in range(8)] == [16] * 4 + [48] * 4
    assert [config.reset_distance_of(number) for number in range(8)] == [0.3] * 4 + [0.5] * 4


@pytest.mark.parametrize("name", ["panda-random", "panda-circle", "tiago-line", "khan8-q7q8", "panda-glue"])
def test_other_arms_and_tasks_are_trained(name):
    """Limits, a prismatic joint 1, points that are held, and references without a joint path."""
    trainer = made(BILINEAR.replace(scenario=name, task=None, segments=1))
    before = weights_hash(trainer.model)
    (metrics,) = play_segments(trainer, [0])
    assert metrics["train/refused"] == 0.0
    assert np.isfinite(metrics["train/loss"])
    assert weights_hash(trainer.model) != before


def test_scenarios_that_cannot_be_differentiated_are_refused():
    noisy = scenarios.get("varga7-random").replace(plant=Plant(noise=0.1))
    with pytest.raises(InvalidInputError, match="expected an ideal plant"):
        Law(noisy, Bilinear())
    with pytest.raises(InvalidInputError, match="first pose"):
        Law(scenarios.get("zhang3-helix"), Bilinear())


def test_imitation_learns():
    """A residual agent comes to do what another setting of its base policy does."""
    config = Imitate(
        scenario="varga7-random",
        steps=60,
        base_policy="dls:gain=0.02",
        hidden=(32, 32),
        offsets=(1, 2, 10, 30),
        expert="dls:gain=0.3,damping=1e-2",
        n_envs=32,
        example_every=1,
        segments=3,
        gradient_steps=300,
        batch_size=256,
        learning_rate=3e-3,
    )
    trainer = made(config)
    play_segments(trainer, range(3))
    features, wanted, _ = trainer._examples
    missed = network_outputs(trainer.model, features.numpy()) - wanted.numpy()
    # Outputs of 0 would miss as much as the targets are, and a wrong gradient more.
    assert np.median(np.abs(missed)) < 0.7 * np.median(np.abs(wanted.numpy()))


@pytest.mark.parametrize("inverse", [{}, {"damping": 1e-2}, {"damping": 1e-2, "matrix": False}])
def test_bilinear_students_say_what_their_agents_do(inverse):
    """The velocities that the loss is made of, in units of the speed, are the actions of the agent."""
    config = Imitate(**POSE, expert="dls", output="bilinear", **inverse)
    scenario = config.make_scenario()
    pupil = student(config, scenario)
    with torch.no_grad():
        pupil.actor[-1].bias.normal_(0.0, 0.1)
    view, wrong = View(pupil.processing, scenario), np.random.default_rng(0)
    seen = []

    def act(out):
        shown = np.ascontiguousarray(out.nominal[:, np.array(config.offsets) - 1])
        features = view.see(observation(out) | {"nominal": shown}, np.zeros(len(out.q), dtype=np.bool_))
        action = view.act(network_outputs(pupil.model, features))
        target, given = pupil.example(view.batch, action.astype(np.float32), None)
        seen.append((target, pupil.said(torch.from_numpy(features), torch.from_numpy(given)).detach().numpy()))
        return action + 0.01 * wrong.normal(size=action.shape)  # errors are seen, too

    for _ in play_episodes(scenario, range(3), act, preview=config.offsets[-1]):
        pass
    targets, said = (np.concatenate(part) for part in zip(*seen, strict=True))
    assert len(said) == 3 * 20
    assert np.abs(said).max() > 0.1
    np.testing.assert_allclose(said, targets, rtol=1e-4, atol=1e-4)


def test_bilinear_students_learn_and_apg_goes_on_with_them(tmp_path):
    """One that begins as a damped inverse comes to do what damped least squares with another damping does."""
    config = Imitate(
        **POSE | {"steps": 60, "hidden": (32, 32), "n_envs": 32},
        expert="dls:gain=1.0,damping=0.5",
        output="bilinear",
        damping=1e-2,
        example_every=1,
        gradient_steps=300,
        batch_size=256,
        learning_rate=3e-3,
    )
    untrained, trainer = made(config), made(config)
    play_segments(trainer, range(3))
    features, wanted, given = trainer._examples
    students = untrained._student, trainer._student
    missed = [(pupil.said(features, given).detach() - wanted).abs().median() for pupil in students]
    assert missed[1] < 0.5 * missed[0]
    scenario = config.make_scenario()
    layers = [layer for layer in trainer.model.policy if isinstance(layer, torch.nn.Linear)]
    weights, biases = ([getattr(layer, name).detach().numpy() for layer in layers] for name in ("weight", "bias"))
    file = tmp_path / "agent.safetensors"
    save_agent(file, Network(tuple(weights), tuple(biases), "silu", "linear"), config.processing, scenario)
    goes_on = inherit(APG(**POSE, init=file, hold=8, segment_steps=48, window=(16, 48)), ())
    assert goes_on.processing == config.processing
    assert weights_hash(made(goes_on).model) == weights_hash(trainer.model)


def test_episodes_are_of_the_split_for_training():
    trainer = made(CONFIGS["apg"])
    play_segments(trainer, [0, 1, 2])
    assert set(trainer._arms.seed.tolist()) <= set(scenarios.SPLITS["train"])


@pytest.mark.parametrize(
    ("kind", "changes", "error", "message"),
    [
        (APG, {"window": 64}, InvalidInputError, "window: expected whole numbers, got 64"),
        (APG, {"window": (60,)}, InvalidInputError, "window: expected multiples of hold, 8, .* got 60"),
        (APG, {"window": (88,)}, InvalidInputError, "window: expected .* that divide segment_steps, 1920, got 88"),
        (APG, {"offsets": (2, 5)}, InvalidInputError, "offsets: expected at least two, rising from 1"),
        (APG, {"averaging": 1.5}, InvalidInputError, "averaging: expected a number from 0 to 1, got 1.5"),
        (APG, {"reset_distance": -1.0}, InvalidInputError, "reset_distance"),
        (Imitate, {"algorithm": "ddpg"}, UnknownNameError, "algorithm"),
        (Imitate, {"beta": 1.5}, InvalidInputError, "beta: expected a number from 0 to 1, got 1.5"),
        (Imitate, {"tolerance": 0.0}, InvalidInputError, "tolerance"),
        (Imitate, {"gradient_steps": 0}, InvalidInputError, "gradient_steps"),
        (Imitate, {"output": "bilinar"}, UnknownNameError, "Did you mean 'bilinear'"),
        (Imitate, {"damping": 1e-2}, InvalidInputError, "damping: expected None for an output that is velocities"),
        (Imitate, {"matrix": False}, InvalidInputError, "matrix: expected True for an output that is velocities"),
        (Imitate, {"output": "bilinear", "matrix": False}, InvalidInputError, "damping: expected a number where"),
        (Imitate, {"output": "bilinear", "base_policy": "dls"}, InvalidInputError, "base_policy: expected None"),
        (Imitate, {"output": "bilinear", "null_space": 1e-2}, InvalidInputError, "null_space: expected None"),
        (Imitate, {"output": "bilinear", "offsets": (2, 5)}, InvalidInputError, "offsets: .* rising from 1"),
    ],
)
def test_bad_configurations_are_refused(kind, changes, error, message):
    with pytest.raises(error, match=message):
        kind(**changes)


def test_unknown_experts_are_refused():
    with pytest.raises(UnknownNameError, match="Did you mean 'dls'"):
        made(Imitate(**SMALL, expert="dlss"))
