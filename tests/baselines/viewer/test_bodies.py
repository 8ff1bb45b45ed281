"""Bodies and obstacles in the viewer: where they are, that they move, and that they can be switched off."""

import numpy as np
import pytest

from baselines.viewer.replay import Stage
from baselines.viewer.session import Session
from ikgym.obstacles.solids import closest, cut_half_spaces
from tests.bodied import blocked, crowd

transforms = pytest.importorskip("viser.transforms")
servers = pytest.importorskip("baselines.viewer.server")
place = pytest.importorskip("tests.baselines.viewer.test_arms").place


@pytest.fixture
def viewer(server):
    return servers.Viewer(server, Session(Stage.of(crowd()), ["dls"]))


def test_bodies_obstacles_and_the_line_are_where_the_kernels_have_them(viewer):
    session = viewer.session
    session.scrub(0.05)
    viewer.tick(1.0)
    (drawn,), (arm,), scenario = viewer.drawing._bodies, viewer.drawing._arms, session.stage.scenario
    q, boxes = session.replays[0].q[session.step], scenario.obstacle_rows(61)[session.step]
    found = closest(scenario.arm, q[None], boxes[None], scenario.surroundings.checked)
    for number, link in enumerate(scenario.arm.bodies.links):
        at = place([*arm._frames[:link], drawn._bodies[number]]).translation()
        np.testing.assert_allclose(at, found.bodies[0, number, 9:12], atol=1e-5)
    for handle, box in zip(drawn._obstacles, cut_half_spaces(boxes, drawn._edge), strict=True):
        np.testing.assert_allclose(handle.position, box[9:12], atol=1e-6)
        np.testing.assert_allclose(transforms.SO3(np.array(handle.wxyz)).as_matrix().ravel(), box[:9], atol=1e-6)
    np.testing.assert_allclose(drawn._line.points, found.points, atol=1e-6)
    assert drawn._distance.text == f"{1e3 * found.distances[0]:.1f} mm"
    assert f"{drawn._distance.text} between" in viewer.readings.content


def test_they_are_switched_off_and_on(viewer):
    (drawn,) = viewer.drawing._bodies
    handles = [*drawn._bodies, *drawn._obstacles, drawn._line, drawn._distance]
    assert viewer.bodies.value
    for on in (False, True):
        viewer.drawing.show_bodies(on)
        viewer.tick(1.0)
        assert [handle.visible for handle in handles] == [on] * len(handles)


def test_without_collisions_they_are_off_and_without_bodies_not_there(server):
    off = servers.Viewer(server, Session(Stage.of(crowd(steps=5).replace(collisions=False)), ["dls"]))
    assert not off.bodies.value
    assert not off.drawing._bodies[0]._bodies[0].visible
    assert " between " not in off.session.text(off.session.views())
    server.scene.reset()
    server.gui.reset()
    none = servers.Viewer(server, Session(Stage.of("varga7-fast", steps=5), ["dls"]))
    assert not hasattr(none, "bodies")
    assert none.drawing._bodies == []


def test_an_arm_that_is_stopped_is_shown_at_its_obstacle(server):
    viewer = servers.Viewer(server, Session(Stage.of(blocked()), ["dls"]))
    viewer.session.scrub(1.5)
    text = viewer.session.text(viewer.session.views())
    assert "- 0.0 mm between" in text
    assert "and post" in text
