"""Learning environments can be drawn and recorded: one arm, N arms, and those of Stable-Baselines3."""

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from gymnasium.wrappers.vector import RecordVideo as RecordVideos

import ikgym
import ikgym.sb3
from ikgym import rl
from ikgym.exceptions import ResetNeededError
from ikgym.rendering.renderer import HEIGHT, WIDTH

STEPS = 3
SHORT = ikgym.scenarios.get("panda-random").replace(steps=STEPS)


def native(n, **options):
    return rl.make_vec(SHORT, n, render_mode="rgb_array", **options)


@pytest.mark.parametrize("mode", AutoresetMode)
def test_pictures_of_many_are_those_of_single_ones(mode):
    ours = native(2, autoreset_mode=mode)
    theirs = SyncVectorEnv([lambda: rl.make(SHORT, render_mode="rgb_array")] * 2, autoreset_mode=mode)
    with pytest.raises(ResetNeededError, match="call reset"):
        ours.render()
    for envs in (ours, theirs):
        envs.reset(seed=3)
    for _ in range(STEPS + 2):
        for envs in (ours, theirs):
            *_, truncated, _ = envs.step(np.full((2, 7), 0.5, dtype=np.float32))
            if mode is AutoresetMode.DISABLED and truncated.any():
                envs.reset(options={"reset_mask": truncated})
    for mine, other in zip(ours.render(), theirs.render(), strict=True):  # in their second episodes
        np.testing.assert_array_equal(mine, other)


def test_episodes_of_many_arms_are_recorded_side_by_side(tmp_path):
    pytest.importorskip("moviepy")
    envs = RecordVideos(native(4), str(tmp_path / "videos"), episode_trigger=lambda _: True)
    envs.reset(seed=0)
    envs.step(np.zeros((4, 7), dtype=np.float32))
    assert np.array(envs.recorded_frames).shape == (2, 4 * HEIGHT * WIDTH // (2 * WIDTH), 2 * WIDTH, 3)
    envs.close()
    assert len(list(tmp_path.glob("videos/*.mp4"))) == 1


def test_arms_of_stable_baselines3_are_drawn():
    envs = ikgym.sb3.make_vec(SHORT, 2, render_mode="rgb_array")
    envs.reset()
    assert envs.render_mode == "rgb_array"
    assert [picture.shape for picture in envs.get_images()] == 2 * [(HEIGHT, WIDTH, 3)]
