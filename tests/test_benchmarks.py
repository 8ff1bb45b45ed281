"""The benchmarks run; how fast they find us is nobody's test."""

from __future__ import annotations

import numpy as np

import baselines
from benchmarks import environments, kernels, policies, timing


def test_medians_are_of_what_was_called():
    counts = {"a": 0, "b": 0}

    def count(name):
        counts[name] += 1

    times = timing.medians({name: lambda name=name: count(name) for name in counts}, rounds=3, seconds=1e-5)
    assert set(times) == set(counts)
    assert all(t > 0 for t in times.values())
    assert all(n > 3 for n in counts.values())


def test_environments_step():
    for call in {**environments.single(), **environments.vector(3)}.values():
        call()


def test_both_kinematics_are_of_the_same_arm():
    import pinocchio as pin

    import ikgym

    arm = ikgym.arms.get("varga7")
    model, frame = kernels.pinocchio_model(arm)
    q = np.random.default_rng(0).uniform(-1, 1, 7)
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    np.testing.assert_allclose(data.oMf[frame].translation, arm.forward(q)[1], atol=1e-12)
    for call, poses in kernels.kinematics().values():
        call()
        assert poses >= 1


def test_policies_are_those_of_their_scenarios():
    for scenario, labelled in policies.POLICIES.items():
        for name, parameters in labelled.values():
            assert baselines.make(name, scenario, **parameters).name == name


def test_iterations_are_counted_as_made():
    for call, iterations in policies.damped_iterations(rows=2, iterations=3).values():
        call()
        assert iterations == 6
