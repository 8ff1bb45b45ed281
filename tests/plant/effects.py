"""Plants with one effect each, and with all of them."""

import ikgym
from ikgym import Plant

#: Each effect at a size that shows within some steps.
EFFECTS = {
    "zero": {"zero": 5e-3},
    "link": {"link": 3e-3},
    "axis": {"axis": 5e-3},
    "payload": {"payload": 1e-2, "payload_step": 4},
    "arms": {"arms": (ikgym.arms.get("panda-2"), ikgym.arms.get("panda-3"))},
    "bandwidth": {"bandwidth": (10.0, 20.0)},
    "command_delay": {"command_delay": (2, 5)},
    "drive": {"drive": (1.1, -0.4, 0.05, 0.05, 0.1, 0.1, 0.05)},
    "gain": {"gain": (0.9, 1.0, 1.1, 1.0, 0.95, 1.0, 1.0)},
    "resonance": {"resonance": (10.0, 12.0, 15.0, 20.0, float("inf"), 40.0, 80.0)},
    "backlash": {"backlash": 1e-3},
    "bias": {"bias": 0.1},
    "noise": {"noise": 0.1},
    "q_noise": {"q_noise": 1e-4},
    "pose_noise": {"pose_noise": 1e-3},
    "pose_rotation_noise": {"pose_rotation_noise": 1e-3},
    "q_delay": {"q_delay": 2},
    "pose_delay": {"pose_delay": 3},
    "pose_every": {"pose_every": 3},
    "pose_missing": {"pose_missing": 0.4},
}
ALL = Plant(**{name: value for effect in EFFECTS.values() for name, value in effect.items()})
CONTEXT = ikgym.scenarios.get("learning-context").plant.replace(payload_step=4, pose_delay=3, from_middle=(0.0, 1.0))
PLANTS = {"context": CONTEXT, **{name: Plant(**effect) for name, effect in EFFECTS.items()}, "all": ALL}


def panda(plant=None, steps=12, **changes):
    """Random motions of a Panda."""
    scenario = ikgym.scenarios.get("panda-random")
    return scenario.replace(steps=steps, plant=Plant() if plant is None else plant, **changes)
