"""Bodies and obstacles in the replay of the page, in a real browser."""

from baselines.evaluate import evaluate
from tests.baselines.evaluation.html.test_browser import opened
from tests.bodied import blocked
from tests.chromium import chromium


def test_bodies_and_the_closest_pair_are_in_the_replay(tmp_path):
    (row,) = evaluate(blocked(), "dls", out=tmp_path, report=True)
    with chromium() as browser, opened(browser, tmp_path) as tab:
        replay = "document.getElementById('replay')"
        names = tab.evaluate(f"{replay}.data.map(trace => trace.name)")
        assert names[6:] == ["bodies", "obstacles", "closest pair"]
        assert tab.evaluate("document.getElementById('errors').data.length") == 3
        assert tab.locator("#errors-head").text_content() == "Errors and clearance over time"
        ends = f"[0, 1].map(k => ['x', 'y', 'z'].map(axis => {replay}.data[8][axis][k]))"
        tab.evaluate("seek(0)")
        tab.wait_for_function(f"{replay}.data[8].x.length === 2")
        first, last = tab.evaluate(ends)
        start = sum((a - b) ** 2 for a, b in zip(first, last, strict=True)) ** 0.5
        tab.evaluate(f"seek({row.stopped * 1e-3})")
        tab.wait_for_timeout(500)
        first, last = tab.evaluate(ends)
        assert sum((a - b) ** 2 for a, b in zip(first, last, strict=True)) ** 0.5 < 1e-3 < start
        assert "clearance" in tab.evaluate(f"{replay}.layout.annotations[0].text")
        assert tab.locator("#bodies").is_visible()
        tab.uncheck("#bodies")
        tab.wait_for_function(f"{replay}.data[6].visible === false")
        assert tab.evaluate(f"{replay}.data[5].visible") in (None, True)
