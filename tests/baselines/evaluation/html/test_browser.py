"""The page in a real browser: no errors, and it sorts, filters, plays, shows bodies, and fits a phone."""

import pytest

from baselines.evaluation.results import PAGE, read_rows
from tests.baselines.evaluation.html.conftest import NASTY
from tests.chromium import READY, chromium

pytestmark = pytest.mark.slow  # the page as text is tested always, in test_page.py
REPLAY = "document.getElementById('replay')"


@pytest.fixture(scope="module")
def tab(folder):
    """The page; no error may occur, and nothing may be loaded."""
    wrong = []
    with chromium() as browser:
        tab = browser.new_page(viewport={"width": 1100, "height": 700})
        tab.set_default_timeout(READY)
        tab.on("pageerror", lambda error: wrong.append(str(error)))
        tab.on("console", lambda message: wrong.append(message.text) if message.type == "error" else None)
        tab.on("request", lambda request: wrong.append(request.url))
        tab.goto((folder / PAGE).as_uri())
        tab.wait_for_selector("html[data-ready]")
        yield tab
        assert [url for url in wrong if not url.startswith(("file:", "data:", "blob:"))] == []


def names(tab):
    return tab.eval_on_selector_all("#results tbody .name", "cells => cells.map(cell => cell.textContent)")


def test_plots_and_replay(tab):
    assert tab.evaluate("document.getElementById('cost-time').data.length") == 4
    assert tab.evaluate("document.getElementById('errors').data.length") == 3 * 2
    assert tab.evaluate("document.getElementById('joints').data.length") == 3 * 7
    assert tab.evaluate(f"{REPLAY}.data.length") == 3 * 6
    tab.evaluate("seek(0.2)")
    assert tab.text_content("#clock") == "0.200 s"
    assert tab.evaluate(f"{REPLAY}.data[1].x.length") == pytest.approx(400 * 0.2 / 0.45, abs=2)
    assert "dls" in tab.evaluate(f"{REPLAY}.layout.annotations[0].text")
    tab.select_option("#quantity", "qdot")
    tab.locator("#results tbody input:checked").first.uncheck()
    tab.wait_for_function(f"{REPLAY}.data.length === 12")
    tab.click("#play")
    tab.wait_for_function("PLAYER.time > 0.21")
    tab.click("#play")


def test_the_table_sorts_and_filters(tab):
    assert len(names(tab)) == 9
    head = tab.locator("#results thead th", has_text="total cost").first
    orders = []
    for direction in ("ascending", "descending"):
        head.click()
        tab.wait_for_selector(f"#results th[aria-sort={direction}]")
        cells = "lines => lines.map(line => Number(line.children[3].dataset.order))"
        orders.append(tab.eval_on_selector_all("#results tbody tr", cells))
    assert orders[0] == sorted(orders[0])
    assert orders[1] == sorted(orders[1], reverse=True)
    tab.fill("input[type=search]", "moore short")
    assert names(tab) == ["moore_penrose"]
    tab.fill("input[type=search]", "")
    tab.select_option("#scenario", NASTY)
    assert len(names(tab)) == 4
    assert tab.locator("#results tbody input:checked").count() == 3


def test_bodies_and_the_closest_pair_are_in_the_replay(tab, folder):
    stopped = read_rows(folder / "results.json")[-1].stopped
    tab.select_option("#scenario", "panda-blocked")
    tab.wait_for_function(f"{REPLAY}.data.length === 9")
    assert tab.evaluate(f"{REPLAY}.data.map(trace => trace.name)")[6:] == ["bodies", "obstacles", "closest pair"]
    assert tab.evaluate("document.getElementById('errors').data.length") == 3
    assert tab.locator("#errors-head").text_content() == "Errors and clearance over time"
    ends = f"[0, 1].map(k => ['x', 'y', 'z'].map(axis => {REPLAY}.data[8][axis][k]))"
    tab.evaluate("seek(0)")
    tab.wait_for_function(f"{REPLAY}.data[8].x.length === 2")
    first, last = tab.evaluate(ends)
    assert sum((a - b) ** 2 for a, b in zip(first, last, strict=True)) > 1e-6
    tab.evaluate(f"seek({stopped * 1e-3})")
    tab.wait_for_function(
        f"Math.hypot(...['x', 'y', 'z'].map(axis => {REPLAY}.data[8][axis].reduce((a, b) => a - b))) < 1e-3"
    )
    assert "clearance" in tab.evaluate(f"{REPLAY}.layout.annotations[0].text")
    tab.uncheck("#bodies")
    tab.wait_for_function(f"{REPLAY}.data[6].visible === false")
    assert tab.evaluate(f"{REPLAY}.data[5].visible") in (None, True)


def test_the_table_fits_a_laptop(tab):
    tab.select_option("#scenario", "")
    tab.set_viewport_size({"width": 1400, "height": 700})
    width, needed = tab.eval_on_selector(".dt-layout-table", "part => [part.clientWidth, part.scrollWidth]")
    assert needed <= width


def test_it_fits_a_phone(tab):
    tab.set_viewport_size({"width": 390, "height": 700})
    tab.wait_for_function("document.documentElement.scrollWidth <= 390")


@pytest.mark.parametrize("longer", ["", ":damping=0.05" * 4])
def test_the_words_of_the_replay_fit_a_phone(tab, longer):
    tab.set_viewport_size({"width": 390, "height": 700})
    tab.wait_for_function(f"{REPLAY}._fullLayout.width <= 390")
    tab.evaluate(f"for (const {{ entry }} of PLAYER.arms) entry.policy += '{longer}'")
    tab.evaluate("seek(0.1)")
    ends = tab.eval_on_selector_all(
        "#replay .annotation",
        "words => words.map(one => one.getBoundingClientRect()).map(one => [one.left, one.right])",
    )
    assert ends
    assert all(0 <= left < right <= 390 for left, right in ends)
