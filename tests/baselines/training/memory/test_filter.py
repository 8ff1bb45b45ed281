"""The filter in PyTorch against that of the runtime, and random plants."""

import numpy as np
import torch

import ikgym
from baselines.agents.recurrent.kernels import describe as describe_row
from baselines.agents.recurrent.network import step_network
from baselines.policy import Batch, Problem
from baselines.solvers.adaptive.corrected import Measurement
from baselines.training.memory.episodes import draw_plant, joined, measure, taken
from baselines.training.memory.filter import Gated, describe, errors, loss
from tests.baselines.agents.recurrent.recurrent_agents import PROCESSING, SIZES, made

FIELD = ikgym.scenarios.get("panda-field").replace(steps=60)
#: Lost poses, noise, and a payload in the middle.
PLANT = FIELD.plant.replace(
    bandwidth=float("inf"), command_delay=0, pose_every=6, pose_missing=0.3, payload_step=30, payload=2e-3
)
SEEDS = ikgym.scenarios.seeds("train", 3)


def network(seed=0):
    torch.manual_seed(seed)
    made = Gated(SIZES)
    torch.nn.init.normal_(made.head.weight)
    return made


def measured():
    return measure(FIELD.replace(plant=PLANT), SEEDS, 10)


def test_units_and_features_are_those_of_the_runtime():
    rng, one = np.random.default_rng(0), network()
    hidden, state = np.zeros(7, np.float32), one.start(1)
    for _ in range(3):
        surprise, loaded, spread = rng.normal(0.0, 1e-3, 6), rng.normal(size=6), rng.uniform(0.0, 1e-6, 6)
        features, output = np.empty(13, np.float32), np.empty(4, np.float32)
        describe_row(surprise, loaded, spread, 17, features)
        step_network(*one.to_runtime().constants, features, hidden, output)
        rows = (torch.from_numpy(x)[None] for x in (surprise, loaded, spread))
        seen = describe(*rows, torch.tensor([17.0], dtype=torch.float64))
        with torch.no_grad():
            wanted, state = one(seen.float(), state)
        np.testing.assert_allclose(features, seen[0].numpy(), rtol=1e-6)
        np.testing.assert_allclose(output, wanted[0].numpy(), rtol=2e-5, atol=1e-6)
        np.testing.assert_allclose(hidden, torch.cat(state, 1)[0].numpy(), rtol=2e-5, atol=1e-6)


def test_estimates_are_those_of_the_runtime():
    """Shown the same measurements; kinematics are linear to some hundredths of a millimetre."""
    one, shown, scenario = network(), measured(), FIELD.replace(plant=PLANT)
    with torch.no_grad():
        _, after = errors(one, PROCESSING, shown)
    policy = made(one.to_runtime(), scenario)
    for row, seed in enumerate(SEEDS):
        off = _played(policy, scenario, seed)
        np.testing.assert_allclose(after[row].numpy(), off, atol=2e-5)
        assert np.abs(off).max() > 2e-4  # the payload


def _played(policy, scenario, seed):
    """How far the estimates of the runtime are off at each measurement. Shape (T, 6)."""
    from baselines.training.memory.episodes import _velocity, linearise_rows, play

    own, out, step = policy.own_memory(1), [], 0
    velocity = _velocity(scenario, seed) / scenario.velocity_limit
    first = np.ones(1, dtype=np.bool_)

    def act(seen):
        nonlocal own, step
        new = seen.pose_age[0] == 0.0
        batch = Batch(*(getattr(seen, name) for name in ("q", "qdot", "pose", "nominal", "remaining")))
        told, old = np.empty((2, 1, 6))
        at = Measurement(np.array(new), first if step == 0 else ~first, seen.q.copy(), own.before, own.age)
        own = policy.learn(batch, at, own, told, old)
        if step % PLANT.pose_every == 0:
            error, true, rate = np.empty((1, 6)), np.empty((1, 6)), np.empty((1, 6, 45))
            chain = Problem.of(scenario).model.chain
            linearise_rows(chain, seen.q.copy(), seen.pose.copy(), seen.true_pose.copy(), error, true, rate)
            out.append(true[0] - told[0])
        step += 1
        return velocity[None, step - 1]

    for _ in play(scenario, [seed], act, preview=1):
        pass
    return np.array(out)


def test_gradients_are_those_of_differences():
    one, shown = network().double(), measure(FIELD.replace(plant=PLANT), SEEDS, 6)
    value = loss(one, PROCESSING, shown, 1e-3, 0.1)
    value.backward()
    for parameter in one.parameters():
        direction = torch.randn_like(parameter)
        with torch.no_grad():
            ends = []
            for sign in (1.0, -1.0):
                parameter += sign * 1e-5 * direction
                ends.append(loss(one, PROCESSING, shown, 1e-3, 0.1).item())
                parameter -= sign * 1e-5 * direction
        slope = (ends[0] - ends[1]) / 2e-5
        assert abs(slope - (parameter.grad * direction).sum().item()) < 1e-6 + 1e-4 * abs(slope)


def test_lost_measurements_change_nothing():
    one, shown = network(), measured()
    noisier = shown._replace(error=torch.where(shown.arrived[..., None], shown.error, shown.error + 1.0))
    assert not shown.arrived.all()
    for a, b in zip(errors(one, PROCESSING, shown), errors(one, PROCESSING, noisier), strict=True):
        assert torch.equal(a, b)


def test_episodes_of_several_plants_stand_side_by_side():
    shown = measured()
    shorter = measure(FIELD.replace(plant=PLANT.replace(pose_every=10)), SEEDS[:2], 10)
    both = joined([shown, shorter], 10)
    assert both.error.shape == (5, 10, 6)
    assert both.steps.tolist() == [6.0, 6.0, 6.0, 10.0, 10.0]
    assert not both.arrived[3:, 6:].any()
    assert torch.equal(taken(both, torch.tensor([1])).error[0], shown.error[1])


def test_plants_are_drawn_from_a_generator_alone():
    plants = [draw_plant(np.random.default_rng(seed), PROCESSING, 96, 3000) for seed in (0, 0, 1, 2, 3, 4, 5)]
    assert plants[0] == plants[1] != plants[2]
    assert len({plant.pose_every for plant in plants}) > 1
    assert {plant.pose_noise == 0.0 for plant in plants} == {True, False}
