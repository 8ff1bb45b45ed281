"""Settings that all tests share, in force before anything that heeds them is imported."""

import os

import pytest
from hypothesis import settings

os.environ["MPLBACKEND"] = "Agg"

# The first call of a kernel compiles it, so no deadline; the same examples everywhere, so no surprise in CI.
settings.register_profile("ikgym", deadline=None, derandomize=True, database=None)
settings.load_profile("ikgym")


@pytest.fixture(scope="session", autouse=True)
def optima_of_our_own(tmp_path_factory):
    """Tests neither read nor fill the user's folder of optima."""
    os.environ["IKGYM_CACHE"] = str(tmp_path_factory.mktemp("optima"))


@pytest.fixture
def own_registries(monkeypatch):
    """What a test registers is gone after it."""
    from ikgym import arms, scenarios

    for registry in (arms._registry, scenarios._registry):
        monkeypatch.setattr(registry, "_makers", dict(registry._makers))
        monkeypatch.setattr(registry, "_made", dict(registry._made))


@pytest.fixture
def one_thread():
    """Torch's threads spend their time waiting for each other in networks this small."""
    import torch

    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)
