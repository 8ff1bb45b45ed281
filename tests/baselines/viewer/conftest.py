"""A server of viser on a free port, one for all tests of a module."""

import pytest

HOST = "127.0.0.1"


@pytest.fixture(scope="module")
def serving():
    pytest.importorskip("viser")
    from baselines.viewer.server import serving

    with serving(HOST, 0) as made:
        yield made


@pytest.fixture
def server(serving):
    """With an empty scene and no controls."""
    serving.scene.reset()
    serving.gui.reset()
    return serving
