"""The control loop on an arm at the other end of a connection: here a mock arm, which refuses what a real one refuses.

For a real arm, write a class with the same three functions: `read` waits for the newest state, `write` sends joint
velocities, `stop` switches the arm off.
"""

import sys

import numpy as np

import ikgym
from baselines import Controller
from baselines.controller import MockArm
from ikgym.plant import Plant


def main(seconds=1.0, period=0.001, real_time=False):
    """Drives a Panda on a circle, with drives that lag by 20 ms, late and lost messages, and noisy encoders."""
    scenario = ikgym.scenarios.get("panda-circle").replace(dt=period, steps=round(seconds / period), jerk_limit=None)
    drives = Plant(bandwidth=8.0, command_delay=2, q_noise=1e-5)
    controller = Controller(scenario)
    controller.warm_up()
    reference = scenario.nominal(preview=controller.ahead)
    errors = []
    with MockArm(scenario.replace(plant=drives), real_time=real_time, jitter=0.1, lost=1e-3) as arm:
        for k in range(scenario.steps):
            state = arm.read()
            if state.reflex is not None or controller.stopped is not None:
                print(f"stopped after {state.time:.3g} s: {state.reflex or controller.stopped.label}")
                break
            ahead = reference[k + 1 : k + 1 + controller.ahead]
            arm.write(controller.step(state.q, None, ahead, commanded=state.commanded))
            errors.append(np.linalg.norm(scenario.arm.forward(state.q)[1] - reference[k, -3:]))
    print(f"{len(errors)} periods; the tool erred by {1e3 * max(errors, default=0.0):.3g} mm at most")
    return errors


if __name__ == "__main__":
    main(*map(float, sys.argv[1:]))
