"""Chromium, for tests of pages; they are skipped where it is missing."""

import contextlib
import shutil

import pytest

NAMES = ("chromium", "chromium-browser", "google-chrome")
FLAGS = (
    "--headless", "--no-sandbox", "--no-first-run", "--disable-background-networking", "--disable-sync",
    "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
)  # fmt: skip
#: Longest wait for a page, in [ms].
READY = 120_000


@contextlib.contextmanager
def chromium():
    """A browser."""
    sync_api = pytest.importorskip("playwright.sync_api", reason="no playwright: pip install 'ikgym[dev]'")
    found = next(filter(None, map(shutil.which, NAMES)), None)
    if found is None:
        pytest.skip(f"no browser: none of {', '.join(NAMES)} is installed")
    with sync_api.sync_playwright() as playwright:
        yield playwright.chromium.launch(executable_path=found, args=FLAGS, timeout=READY)
