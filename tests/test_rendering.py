import itertools
import logging
import pickle
import subprocess

import gymnasium as gym
import matplotlib.pyplot as plt
import numpy as np
import pytest
from gymnasium.wrappers import RecordVideo

import ikgym
from ikgym.rendering import Renderer, picture, renderer, scene
from ikgym.rendering.renderer import HEIGHT, WIDTH
from tests.bodied import crowd

LINES = ("bodies", "obstacles", "closest pair")
STEPS = 12  # the longest command delay of a scenario, at least


@pytest.fixture(autouse=True)
def no_figure_left():
    before = plt.get_fignums()  # of other tests
    yield
    assert plt.get_fignums() == before


def short(name="varga7-fast", steps=STEPS):
    return ikgym.scenarios.get(name).replace(steps=steps)


def environment(name="varga7-fast", mode="rgb_array", steps=STEPS):
    env = ikgym.RedundantIKEnv(short(name, steps), render_mode=mode)
    env.reset(seed=0)
    return env


def move(env, fraction=0.5):
    return env.step(np.full(env.action_space.shape, fraction, dtype=np.float32))


def renderer_of(env):
    return env.unwrapped._renderers[0]


def artist(env, name):
    (found,) = renderer_of(env).figure.findobj(lambda a: a.get_gid() == name)
    return found


def blank(picture):
    return np.count_nonzero(np.bincount(picture.ravel(), minlength=256)) < 20


def count_paintings(monkeypatch):
    painted = []
    paint = picture.Picture.paint

    def counted(self, *, anew):
        painted.append(anew)
        paint(self, anew=anew)

    monkeypatch.setattr(picture.Picture, "paint", counted)
    return painted


@pytest.mark.parametrize("name", ["varga7-random", "khan8-q1", "planar2-bent", "panda-circle", "tiago-raster"])
def test_arms_and_paths_give_a_picture_of_the_same_even_size(name):
    env = environment(name)
    move(env)
    picture = env.render()
    assert picture.shape == (HEIGHT, WIDTH, 3)
    assert picture.dtype == np.uint8
    assert not blank(picture)
    assert HEIGHT % 2 == WIDTH % 2 == 0


def test_a_picture_changes_with_the_arm_and_only_with_it():
    env = environment()
    pictures = [env.render()]
    for _ in range(2):
        move(env)
        pictures.append(env.render())
    np.testing.assert_array_equal(env.render(), pictures[-1])
    for before, after in itertools.pairwise(pictures):
        assert (before != after).any()
    renderer_of(env)._picture._background = None  # all is drawn anew
    np.testing.assert_array_equal(env.render(), pictures[-1])


@pytest.mark.parametrize("name", ["varga7-random", "panda-shelf"])
def test_a_second_episode_looks_as_if_it_were_the_first(name):
    env, fresh = environment(name), environment(name)
    for _ in range(2):
        move(env, 1.0)
        env.render()
    for one in (env, fresh):
        one.reset(seed=1)
        move(one)
    np.testing.assert_array_equal(env.render(), fresh.render())


def test_prismatic_joints_have_an_artist_of_their_own():
    env = environment()
    for _ in range(3):
        observation, *_ = move(env)
    env.render()
    points = env.scenario.arm.joint_points(observation["q"])
    prismatic = np.array(env.scenario.arm.prismatic)
    drawn = np.transpose(artist(env, "prismatic joint").get_data_3d())
    np.testing.assert_array_equal(drawn[:2], points[prismatic][0])
    assert np.linalg.norm(drawn[1] - drawn[0]) > 0.01
    assert np.isnan(drawn[2]).all()
    turning = np.transpose(artist(env, "revolute joint").get_data_3d())
    np.testing.assert_array_equal(turning, points[~prismatic, 1])
    assert artist(env, "prismatic joint").get_marker() != artist(env, "revolute joint").get_marker()
    # The link is interrupted where the joint is prismatic.
    links = np.transpose(artist(env, "links").get_data_3d())
    assert np.isnan(links).all(axis=1).sum() == prismatic.sum()


@pytest.mark.parametrize("step", [0, 5])
def test_tool_target_and_paths_are_where_they_should_be(step):
    """Also where the episode is entered later."""
    env = environment()
    env.reset(options={"step": step})
    for _ in range(4):
        observation, *_ = move(env)
    env.render()
    rotation, tool = env.scenario.arm.forward(observation["q"])
    nominal = env._simulator.nominal_positions(0)
    np.testing.assert_allclose(np.ravel(artist(env, "tool").get_data_3d()), tool)
    np.testing.assert_allclose(np.ravel(artist(env, "target").get_data_3d()), nominal[step + 4])
    np.testing.assert_allclose(np.transpose(artist(env, "nominal path").get_data_3d()), nominal)
    actual = np.transpose(artist(env, "actual path").get_data_3d())
    assert len(actual) == 5
    np.testing.assert_allclose(actual[-1], tool)
    for name, axis in zip("xyz", rotation.T, strict=True):
        begin, end = np.transpose(artist(env, f"tool {name}").get_data_3d())
        np.testing.assert_allclose(begin, tool)
        np.testing.assert_allclose((end - begin) / np.linalg.norm(end - begin), axis, atol=1e-12)


@pytest.mark.parametrize(("name", "panels"), [("varga7-fast", 2), ("zhang3-helix", 1)])
def test_the_orientation_error_is_shown_where_the_task_has_one(name, panels):
    env = environment(name)
    info = move(env)[-1]
    env.render()
    _, *curves = renderer_of(env).figure.axes
    labels = ["position error [m]", "orientation error [rad]"][:panels]
    assert [axes.get_ylabel() for axes in curves] == labels
    for label in labels:
        kind = label.split(" [")[0]
        time, error = artist(env, kind).get_data()
        assert time[-1] == info["time"]
        assert error[-1] == info[kind.replace(" ", "_")]
    for axes in curves:
        assert axes.get_xlim() == pytest.approx((0.0, STEPS * env.scenario.dt))


def test_long_curves_are_thinned_and_keep_their_peaks():
    states = 10_000
    drawn = Renderer(short("zhang3-helix", states - 1).replace(dt=0.001), "rgb_array")
    drawn.begin(np.ones((states, 3)))
    for k in range(states):
        drawn.add(k, np.full(3, 1e-4 * k), 5.0 if k == 1234 else 1e-3, np.nan)
    drawn.draw()
    (line,) = drawn.figure.findobj(lambda a: a.get_gid() == "position error")
    assert len(line.get_xdata()) <= scene.MOST_POINTS + 1
    assert line.get_ydata().max() == 5.0
    assert line.get_xdata()[-1] == pytest.approx(0.001 * (states - 1))


@pytest.mark.parametrize(("q", "error"), [(0.0, 0.0), (0.0, 1e300), (-1e9, np.inf), (1e6, 1e-300)])
def test_nothing_is_too_far_or_too_small_to_be_drawn(q, error):
    drawn = Renderer(short(steps=2), "rgb_array", title="$diverges_")
    drawn.begin(np.linspace(0.0, 1.0, 3)[:, None] * np.ones(3))
    for k in range(3):
        drawn.add(k, np.full(7, q * (k > 0)), error if k else 0.0, error)
    assert not blank(drawn.draw())


def test_human_mode_without_windows_is_silent_and_says_so_once(caplog):
    with caplog.at_level(logging.INFO, logger="ikgym"):
        env = environment(mode="human")
        for _ in range(STEPS):
            move(env)
        assert env.render() is None
        env.reset()
    (message,) = caplog.messages
    assert "agg" in message.lower()
    assert caplog.records[0].levelno == logging.INFO
    env.close()


def test_a_window_is_drawn_on_until_it_is_closed(monkeypatch):
    """The backend of the tests has no windows; a figure that pyplot keeps takes the place of one."""
    monkeypatch.setattr(renderer.backend_registry, "resolve_backend", lambda name: (name, "pretended"))
    monkeypatch.setattr(renderer.Figure, "show", lambda _: None)
    monkeypatch.setattr(renderer, "INTERVAL", 0.0)
    painted = count_paintings(monkeypatch)
    env = environment(mode="human")
    assert plt.get_fignums() == [renderer_of(env).figure.number]
    move(env)
    assert len(painted) == 2
    plt.close(renderer_of(env).figure)  # what a click on the window's cross does
    move(env)
    env.reset()
    assert len(painted) == 2
    env.close()
    env.reset()
    assert len(painted) == 3
    assert len(plt.get_fignums()) == 1
    for _ in range(2):
        env.close()
        assert plt.get_fignums() == []


def test_a_video_can_be_recorded(tmp_path):
    pytest.importorskip("moviepy")
    ffmpeg = pytest.importorskip("imageio_ffmpeg").get_ffmpeg_exe()
    env = gym.make("RedundantIK-v0", scenario=short(steps=4), render_mode="rgb_array")
    env = RecordVideo(env, str(tmp_path / "videos"), episode_trigger=lambda _: True, disable_logger=True)
    env.reset()
    for _ in range(4):
        *_, truncated, _ = move(env)
    assert truncated
    frames = np.array(env.recorded_frames)
    assert frames.shape == (5, HEIGHT, WIDTH, 3)
    assert all((a != b).any() for a, b in itertools.pairwise(frames))
    env.close()
    (video,) = tmp_path.glob("videos/*.mp4")
    decode = [ffmpeg, "-v", "error", "-i", str(video), "-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    played = subprocess.run(decode, check=True, capture_output=True)
    assert played.stderr == b""
    shown = np.frombuffer(played.stdout, dtype=np.uint8).reshape(-1, HEIGHT, WIDTH, 3)
    assert (shown[0] != shown[-1]).any()  # encoders and decoders may drop frames at either end


def test_copies_draw_the_episode_on_a_figure_of_their_own():
    env, fresh = environment(), environment()
    move(env), move(fresh)
    picture = env.render()
    twin = pickle.loads(pickle.dumps(env))
    assert renderer_of(twin).figure is None
    for each in (env, twin, fresh):
        move(each)
    np.testing.assert_array_equal(twin.render(), fresh.render())
    assert not np.array_equal(picture, env.render())
    assert renderer_of(twin).figure is not renderer_of(env).figure


def test_bodies_obstacles_and_the_closest_pair_are_drawn_where_touching_matters():
    env = ikgym.RedundantIKEnv(crowd(steps=STEPS), render_mode="rgb_array")
    env.reset(seed=0)
    env.render()
    before = np.array(artist(env, "obstacles").get_data_3d())
    for _ in range(3):
        *_, info = move(env)
    env.render()
    bodies, obstacles, pair = (np.array(artist(env, name).get_data_3d()) for name in LINES)
    distance = np.linalg.norm(pair[:, 0] - pair[:, 1])
    assert distance == pytest.approx(info["clearance"], abs=1e-12)
    assert f"clearance {1e3 * distance:.1f} mm" in renderer_of(env)._picture._heading.get_text()
    moved = np.nan_to_num(np.abs(obstacles - before)).max(axis=0) > 0.0
    assert 0.1 < moved.mean() < 0.5  # the ball alone
    middle = env.unwrapped.scenario.arm.joint_points(env.unwrapped._simulator.true_q[0])[3, 1]
    assert np.nanmin(np.linalg.norm(bodies.T - middle, axis=1)) < 0.2


def test_nothing_of_it_is_drawn_elsewhere():
    for scenario in (short("panda-circle"), crowd(steps=STEPS).replace(collisions=False)):
        env = ikgym.RedundantIKEnv(scenario, render_mode="rgb_array")
        env.reset(seed=0)
        env.render()
        assert not renderer_of(env).figure.findobj(lambda a: a.get_gid() in LINES)
        assert "clearance" not in renderer_of(env)._picture._heading.get_text()
