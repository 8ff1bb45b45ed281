"""A Panda that is not that of the data sheet, what its sensors show, and what is learnt of it."""

import numpy as np

import ikgym
from ikgym.kernels.rotations import rodrigues

PANDA = ikgym.arms.get("panda")


def perturbed(seed, size=5e-4):
    """The Panda with other zeros, links and axes.

    Returns:
        The arm, and what has to be added to its joint coordinates.
    """
    rng = np.random.default_rng(seed)
    axes = PANDA.axes.copy()
    for i, axis in enumerate(axes):
        tilt = np.cross(axis, size * rng.standard_normal(3))
        axes[i] = rodrigues(tilt / np.linalg.norm(tilt), np.linalg.norm(tilt)) @ axis
    offsets = PANDA.offsets + size * rng.standard_normal((7, 3))
    return PANDA.replace(offsets=offsets, axes=axes), size * rng.standard_normal(7)


def scenario(task="pose"):
    """What solvers are made for: they know the data sheet."""
    return ikgym.scenarios.get("panda-random").replace(task=ikgym.tasks.get(task), dt=1e-3)


def path(seed, steps):
    """A slow joint path around home. Shape (steps, n)."""
    rng = np.random.default_rng(seed)
    time = np.linspace(0.0, 1.0, steps)[:, None]
    return PANDA.home + 0.5 * np.sin(3.0 * time * rng.uniform(0.5, 1.5, 7)) * rng.choice([-1.0, 1.0], 7)


def observed(on, arm, zeros, q, target=None):
    """What one arm shows; of the pose what the perturbed arm has."""
    pose = on.task.coordinates(*arm.forward(q + zeros))
    nominal = pose if target is None else target
    return {"q": q, "qdot": np.zeros_like(q), "pose": pose, "nominal": nominal[None], "remaining": np.ones(1)}


def noisy(on, observation, rng, noise):
    """An observation with a pose that is measured with noise. Task `pose` alone."""
    rotation, position = observation["pose"][:9].reshape(3, 3), observation["pose"][9:]
    vector = noise * rng.standard_normal(3)
    turn = rodrigues(vector / np.linalg.norm(vector), np.linalg.norm(vector))
    return observation | {"pose": on.task.coordinates(turn @ rotation, position + noise * rng.standard_normal(3))}


def learnt(policy, arm, zeros, q, noise=0.0, state=None, start=None, changed=(0.0, 10**9)):
    """The state after some postures, with a change of the joint zeros from one of them on."""
    on, rng = scenario(), np.random.default_rng(1)
    change, at = changed
    for k, posture in enumerate(q):
        seen = observed(on, arm, zeros + np.asarray(change) * (k >= at), posture)
        _, state = policy.predict(noisy(on, seen, rng, noise) if noise else seen, state, start)
        start = None
    return state


def memory(policy, state):
    """The memory of a wrapper, without that of its base policy."""
    return policy.split(policy.memory_of(state))[0]


def deviation_of(policy, state, q):
    """What a policy takes the deviation to be at a posture."""
    outer = memory(policy, state)
    if hasattr(outer, "deviation"):
        return outer.deviation[0]
    out, batch = np.empty((1, 6)), type("Shown", (), {"q": q[None], "pose": np.zeros((1, 12))})
    measured = type("Measured", (), {name: np.zeros(1, np.bool_) for name in ("new", "first")} | {"q": q[None]})
    policy.learn(batch, measured, outer, out, np.empty((1, 6)))
    return out[0]


def true_deviation(arm, zeros, q):
    """From the data sheet's pose to the arm's. Shape (6,)."""
    task = ikgym.tasks.get("pose")
    return task.error(task.coordinates(*arm.forward(q + zeros)), task.coordinates(*PANDA.forward(q)))
