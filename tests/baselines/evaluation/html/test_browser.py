"""The page in a real browser: no errors, and it sorts, filters, plays, and fits a phone."""

import contextlib

import pytest

from baselines.evaluation.results import PAGE
from tests.baselines.evaluation.html.conftest import NASTY
from tests.chromium import READY, chromium

#: The plots are left out, which take the processor a while.
TABLE_ALONE = "globalThis.requestAnimationFrame = () => 0"


@pytest.fixture(scope="module")
def browser():
    with chromium() as made:
        yield made


@contextlib.contextmanager
def opened(browser, folder, *, width=1100, script=""):
    """The page; no error may occur, and nothing may be loaded."""
    wrong = []
    tab = browser.new_page(viewport={"width": width, "height": 700})
    tab.set_default_timeout(READY)
    tab.add_init_script(script)
    tab.on("pageerror", lambda error: wrong.append(str(error)))
    tab.on("console", lambda message: wrong.append(message.text) if message.type == "error" else None)
    tab.on(
        "request",
        lambda request: None if request.url.startswith(("file:", "data:", "blob:")) else wrong.append(request.url),
    )
    tab.goto((folder / PAGE).as_uri())
    if not script:
        tab.wait_for_selector("html[data-ready]")
    yield tab
    assert wrong == []
    tab.close()


def names(tab):
    return tab.eval_on_selector_all("#results tbody .name", "cells => cells.map(cell => cell.textContent)")


def test_the_table_sorts_and_filters(browser, folder):
    with opened(browser, folder, script=TABLE_ALONE) as tab:
        assert len(names(tab)) == 8
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


def test_plots_and_replay(browser, folder):
    with opened(browser, folder) as tab:
        assert tab.evaluate("document.getElementById('cost-time').data.length") == 4
        assert tab.evaluate("document.getElementById('errors').data.length") == 3 * 2
        assert tab.evaluate("document.getElementById('joints').data.length") == 3 * 7
        assert tab.evaluate("document.getElementById('replay').data.length") == 3 * 6
        tab.evaluate("seek(0.2)")
        assert tab.text_content("#clock") == "0.200 s"
        path = tab.evaluate("document.getElementById('replay').data[1].x.length")
        assert path == pytest.approx(400 * 0.2 / 0.45, abs=2)
        assert "dls" in tab.evaluate("document.getElementById('replay').layout.annotations[0].text")
        tab.select_option("#quantity", "qdot")
        tab.locator("#results tbody input:checked").first.uncheck()
        tab.wait_for_function("document.getElementById('replay').data.length === 12")
        tab.click("#play")
        tab.wait_for_function("PLAYER.time > 0.21")
        tab.click("#play")


def test_it_fits_a_phone(browser, folder):
    with opened(browser, folder, width=390, script=TABLE_ALONE) as tab:
        assert tab.evaluate("document.documentElement.scrollWidth") <= 390
