"""A Panda that is not that of the data sheet, and what its sensors show."""

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


def observed(on, arm, zeros, q, target=None, **extras):
    """What one arm shows; of the pose what the perturbed arm has."""
    pose = on.task.coordinates(*arm.forward(q + zeros))
    nominal = pose if target is None else target
    return {"q": q, "qdot": np.zeros(7), "pose": pose, "nominal": nominal[None], "remaining": np.ones(1), **extras}


def noisy(on, observation, rng, noise):
    """The same with a pose that is measured with noise. Task `pose` alone."""
    rotation, position = observation["pose"][:9].reshape(3, 3), observation["pose"][9:]
    vector = noise * rng.standard_normal(3)
    turn = rodrigues(vector / np.linalg.norm(vector), np.linalg.norm(vector))
    return observation | {"pose": on.task.coordinates(turn @ rotation, position + noise * rng.standard_normal(3))}
