"""The control loop on an arm at the other end of a connection: here a mock arm, which refuses what a real one refuses.

For a real arm, write a class with the same three functions: `read` waits for the newest state, `write` sends joint
velocities, `stop` brings the arm to rest.
"""

import sys

import numpy as np

import ikgym
from baselines import Controller
from baselines.controller import MockArm, use_real_time_priority
from ikgym.plant import Plant


def main(seconds=1.0, period=0.001, real_time=True):
    """Drives a Panda on a circle, with drives that lag by 20 ms, late and lost messages, and noisy encoders."""
    scenario = ikgym.scenarios.get("panda-circle").replace(dt=period, steps=round(seconds / period), jerk_limit=None)
    drives = Plant(bandwidth=8.0, command_delay=2, q_noise=1e-5)
    controller = Controller(scenario)
    controller.warm_up()
    reference = scenario.nominal(preview=controller.ahead)
    errors, times, stopped = [], [], None
    with MockArm(scenario.replace(plant=drives), real_time=real_time, jitter=0.1, lost=1e-3) as arm:
        if real_time:
            use_real_time_priority()
        while len(errors) < scenario.steps and stopped is None:
            k, state = len(errors), arm.read()
            ahead = reference[k + 1 : k + 1 + controller.ahead]
            report = {"commanded": state.commanded, "commanded_acceleration": state.commanded_acceleration}
            arm.write(controller.step(state.q, None, ahead, **report))
            errors.append(np.linalg.norm(scenario.arm.forward(state.q)[1] - reference[k, -3:]))
            times.append(state.time)
            stopped = state.reflex or controller.stopped
    missed = round((times[-1] - times[0]) / period) + 1 - len(times)
    print(f"{len(times)} periods, {missed} more were missed; the tool erred by {1e3 * max(errors):.3g} mm at most")
    if stopped is not None:
        print(f"stopped after {times[-1]:.3g} s: {getattr(stopped, 'label', stopped)}")
    return errors


if __name__ == "__main__":
    main(*map(float, sys.argv[1:]))
