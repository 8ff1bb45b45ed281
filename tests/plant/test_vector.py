"""Plants in single, synchronous and native vector environments, bit for bit."""

import copy

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv

import ikgym
from ikgym import Plant
from tests.comparison import identical
from tests.plant.effects import ALL, panda

N = 3


def pair(scenario, commands=2):
    native = ikgym.RedundantIKVectorEnv(N, scenario, autoreset_mode=AutoresetMode.DISABLED, commands=commands)
    single = [lambda: ikgym.RedundantIKEnv(scenario, commands=commands)] * N
    return native, SyncVectorEnv(single, autoreset_mode=AutoresetMode.DISABLED)


def actions(rng, share=1.1):
    return rng.uniform(-share, share, (N, 7)).astype(np.float32)


@pytest.mark.parametrize("plant", [Plant(), ALL])
def test_partial_resets_put_rows_out_of_step(plant):
    native, sync = pair(panda(plant, steps=9), commands=2 * (not plant.ideal))
    rng = np.random.default_rng(2)
    assert identical(native.reset(seed=5), sync.reset(seed=5))
    for k in range(40):
        if k % 4 == 3:
            mask = np.zeros(N, dtype=bool)
            mask[k % N] = True
            options = {"reset_mask": mask, "q": rng.uniform(-0.1, 0.1, 7) + native.scenario.arm.home}
            options |= {"arm_seed": k} if k % 8 == 3 and plant.draws_arm else {}
            seed = None if k % 12 == 3 else 100 + k
            both = [envs.reset(seed=seed, options=copy.deepcopy(options)) for envs in (native, sync)]
        else:
            command = actions(rng)
            both = [envs.step(command) for envs in (native, sync)]
            if (ended := both[0][3]).any():
                assert identical(*[envs.reset(options={"reset_mask": ended.copy()}) for envs in (native, sync)])
        assert identical(*both)


def test_with_everything_off_the_kernel_of_plants_is_that_of_the_ideal_plant():
    """Commands are shown by the kernel of plants alone."""
    for scenario in (panda(steps=20), ikgym.scenarios.get("khan8-q1").replace(steps=20)):
        ideal, shown = ikgym.RedundantIKEnv(scenario), ikgym.RedundantIKEnv(scenario, commands=1)
        first, second = ideal.reset(seed=3), shown.reset(seed=3)
        assert not second[0].pop("commands").any()
        assert identical(first, second)
        rng = np.random.default_rng(0)
        for _ in range(scenario.steps):
            command = rng.uniform(-1.2, 1.2, scenario.joints)
            got, wanted = shown.step(command), ideal.step(command)
            asked = np.clip(command, -1, 1) * scenario.velocity_limit
            most = scenario.largest_qdot
            np.testing.assert_array_equal(got[0].pop("commands")[0], np.clip(asked, -most, most))
            assert identical(got, wanted)


def test_rows_are_arms_of_their_own_and_an_arm_seed_keeps_one():
    envs = ikgym.RedundantIKVectorEnv(N, panda(Plant(zero=1e-2)))
    home = envs.scenario.arm.home

    def poses(seed, **options):
        return envs.reset(seed=seed, options={"q": home, **options})[0]["pose"]

    drawn = poses(1)
    assert len(np.unique(drawn[:, -1])) == N
    kept = poses(1, arm_seed=7)
    assert identical(kept, poses(50, arm_seed=7))
    assert identical(kept[0], kept[1])
    assert not identical(kept[0], drawn[0])
    mixed = poses(1, arm_seed=[None, 7, 8])
    assert identical(mixed[:2], np.stack([drawn[0], kept[1]]))
    assert not identical(mixed[2], kept[2])
    assert identical(poses(1), drawn)
    arm = envs.scenario.drawn_plant(50, arm_seed=7).arm
    assert identical(kept[0], envs.scenario.task.coordinates(*arm.forward(home)))


def test_an_arm_seed_keeps_the_drives_too_but_no_noise():
    scenario = panda(Plant(bandwidth=(1, 100), command_delay=(0, 9), q_noise=1e-3))
    kept = [scenario.drawn_plant(seed, arm_seed=3) for seed in (1, 2)]
    assert (kept[0].bandwidth, kept[0].command_delay) == (kept[1].bandwidth, kept[1].command_delay)
    assert scenario.drawn_plant(1).bandwidth != scenario.drawn_plant(2).bandwidth
    env = ikgym.RedundantIKEnv(scenario)
    q = scenario.arm.home
    (seen, info), (other, same) = (env.reset(seed=seed, options={"q": q, "arm_seed": 3}) for seed in (1, 2))
    assert not (seen["q"] == other["q"]).any()
    assert identical(info, same)
    assert identical(info["context"], kept[0].context)
    assert not identical(info, env.reset(seed=1)[1])
