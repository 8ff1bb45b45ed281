"""The page in a real browser: it loads without an error, sorts, filters, plays, and fits a telephone."""

import contextlib
import shutil

import pytest

from baselines.evaluation.html import PAGE
from tests.baselines.evaluation.html.conftest import NASTY

NAMES = ("chromium", "chromium-browser", "google-chrome")
#: Drawn by the processor, and quiet: no profile of somebody, no calls home.
FLAGS = (
    "--headless", "--no-sandbox", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--disable-gpu",
)  # fmt: skip
SOFTWARE = ("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
#: Nothing is drawn: that waits for the first frame, which never comes.
TABLE_ALONE = "globalThis.requestAnimationFrame = () => 0"
#: The processor draws one scene in space, not three: the ticks of the others go before anything is drawn.
ONE_SCENE = """addEventListener("DOMContentLoaded", () => {
  for (const box of [...document.querySelectorAll("#results input:checked")].slice(1)) box.checked = false;
})"""
READY = 120_000  # [ms]: space is drawn by the processor, which may have other work


@contextlib.contextmanager
def browser(*flags):
    sync_api = pytest.importorskip("playwright.sync_api", reason="no playwright: pip install 'ikgym[dev]'")
    found = next(filter(None, map(shutil.which, NAMES)), None)
    if found is None:
        pytest.skip(f"no browser: none of {', '.join(NAMES)} is installed")
    with sync_api.sync_playwright() as playwright:
        started = playwright.chromium.launch(executable_path=found, args=[*FLAGS, *flags])
        try:
            yield started
        finally:
            started.close()


@contextlib.contextmanager
def opened(started, folder, *, width=1000, script=""):
    """The page, on which nothing may go wrong.

    Args:
        started: The browser.
        folder: Where the page is.
        width: Of the window, in [px].
        script: Runs before those of the page.
    """
    wrong = []
    tab = started.new_page(viewport={"width": width, "height": 700})
    tab.set_default_timeout(READY)
    tab.add_init_script(script)
    tab.on("pageerror", lambda error: wrong.append(str(error)))
    tab.on("console", lambda message: wrong.append(message.text) if message.type == "error" else None)
    tab.on("dialog", lambda dialog: wrong.append("a name was run as a script"))
    tab.on(
        "request",
        lambda request: None if request.url.startswith(("file:", "data:", "blob:")) else wrong.append(request.url),
    )
    tab.goto(f"file://{folder / PAGE}")
    yield tab
    assert wrong == []
    tab.close()


def column(tab, head):
    """The texts of a column of the lines that are seen."""
    heads = tab.locator("#results thead th").all_text_contents()
    return tab.locator(f"#results tbody tr:not([hidden]) > :nth-child({heads.index(head) + 1})").all_text_contents()


def sorts_and_filters(tab):
    head = tab.get_by_role("button", name="total cost")
    for direction, backwards in (("ascending", False), ("descending", True)):
        head.click()
        assert head.locator("..").get_attribute("aria-sort") == direction
        costs = [float(text) for text in column(tab, "total cost")]
        assert len(set(costs)) > 4
        assert costs == sorted(costs, reverse=backwards)
    tab.get_by_label("Filter").fill("DLS short")
    assert set(column(tab, "policy")) == {"dls", "dls:damping=0.05"}
    assert tab.locator("#count").text_content() == "2 of 8"
    tab.get_by_label("Filter").fill("no such policy")
    assert column(tab, "policy") == []
    tab.get_by_label("Filter").fill("")
    tab.get_by_label("Scenario").select_option(NASTY)
    assert set(column(tab, "scenario")) == {NASTY}
    tab.get_by_label("Scenario").select_option("")


def arm(tab):
    """Where the links of the first replay are."""
    return tab.evaluate("(() => { const { x, y } = PLAYER.scenes[0].plot.data[2]; return [...x, ...y]; })()")


def time(tab):
    return tab.evaluate("PLAYER.time")


def test_the_table_works_before_anything_is_drawn(folder):
    with browser() as started, opened(started, folder, script=TABLE_ALONE) as tab:
        sorts_and_filters(tab)
        assert tab.title().startswith(NASTY)


@pytest.fixture(scope="module")
def page(folder):
    """The page, drawn; the tests below leave it as they find it."""
    with browser(*SOFTWARE) as started, opened(started, folder, script=ONE_SCENE) as tab:
        tab.wait_for_selector("html[data-ready]")
        yield tab


@pytest.mark.slow
class TestDrawn:
    def test_it_draws_all_there_is(self, page):
        assert page.evaluate("WEBGL")
        assert page.locator("#replay canvas").count() >= 1
        assert page.locator("#replay figcaption b").all_text_contents() == ["dls"]
        for plot in ("cost-time", "errors", "joints"):
            assert page.locator(f"#{plot} .main-svg").count() > 0
        assert page.evaluate("document.getElementById('joints').data.length") == 7
        note = page.locator("#replay-note").text_content()
        assert "thinned to 400 of 450 steps" in note

    def test_it_sorts_and_filters(self, page):
        sorts_and_filters(page)

    def test_it_plays_and_pauses(self, page):
        page.get_by_label("Speed").select_option("0.1")
        before = arm(page)
        page.get_by_role("button", name="Play").click()
        page.wait_for_function("PLAYER.time > 0.01")
        page.get_by_role("button", name="Pause").click()
        page.wait_for_function("!PLAYER.busy")
        at = time(page)
        assert arm(page) != before
        assert page.locator("#clock").text_content() == f"{at:.3f} s"
        page.wait_for_timeout(300)
        assert time(page) == at

    def test_keys_play_and_go_by_pictures(self, page):
        page.locator("h2").first.click()  # away from all controls
        page.keyboard.press("End")
        page.wait_for_function("PLAYER.time === PLAYER.end && !PLAYER.busy")
        last = arm(page)
        page.keyboard.press("ArrowLeft")
        page.wait_for_function("PLAYER.time < PLAYER.end && !PLAYER.busy")
        assert page.evaluate("PLAYER.end") - time(page) == pytest.approx(0.001, abs=2e-4)
        assert arm(page) != last
        page.keyboard.press("Home")
        page.wait_for_function("PLAYER.time === 0 && !PLAYER.busy")
        page.keyboard.press("Space")
        page.wait_for_function("PLAYER.playing && PLAYER.time > 0")
        page.keyboard.press("Space")
        page.wait_for_function("!PLAYER.playing && !PLAYER.busy")
        page.get_by_label("Filter").focus()
        page.keyboard.press("Space")
        assert page.get_by_label("Filter").input_value() == " "  # where one writes, it is a letter
        assert not page.evaluate("PLAYER.playing")
        page.get_by_label("Filter").fill("")

    def test_joints_at_a_limit_are_coloured_and_said(self, page):
        entry = "PLAYER.scenes[0].entry"
        held = page.evaluate(f"array({entry}, 'limit').values.findIndex((state) => state > 0)")
        row, joint = divmod(held, 7)
        page.evaluate(f"seek(array({entry}, 'time').values[{row}])")
        page.wait_for_function("!PLAYER.busy")
        colours = page.evaluate("PLAYER.scenes[0].plot.data[3].marker.color")
        names = page.evaluate("['joint', 'acceleration', 'velocity', 'stop'].map(themed)")
        assert colours[joint] in names[1:]
        assert f"joint {joint + 1} at its" in page.locator("#replay figcaption span").first.text_content()

    def test_the_choice_is_that_of_the_ticks(self, page):
        box = page.get_by_label(f"moore_penrose in {NASTY}: show in the pictures")
        drawn = "PLAYER.scenes.length === {} && PLAYER.scenes.every((scene) => scene.plot.data)"
        box.check()
        page.wait_for_function(drawn.format(2))
        assert page.locator("#replay figcaption b").all_text_contents() == ["dls", "moore_penrose"]
        assert page.evaluate("document.getElementById('errors').data.length") == 2 * 2
        box.uncheck()
        page.wait_for_function(drawn.format(1))


@pytest.mark.slow
def test_it_fits_400_pixels_and_shows_the_arms_without_webgl(folder):
    with browser("--disable-3d-apis") as started, opened(started, folder, width=400) as tab:
        tab.wait_for_selector("html[data-ready]")
        assert tab.evaluate("document.documentElement.scrollWidth") == 400
        for name in ("#play", "#time", "#filter", "#cost-time", "#joints", "#replay figure >> nth=0"):
            box = tab.locator(name).bounding_box()
            assert box["x"] >= 0
            assert box["x"] + box["width"] <= 400
        assert "no WebGL" in tab.locator("#replay-note").text_content()
        assert tab.evaluate("PLAYER.scenes.map((scene) => scene.plot.data[0].type)") == ["scatter"] * 3
        before = arm(tab)
        tab.get_by_role("button", name="Play").click()
        tab.wait_for_function("PLAYER.time > 0.05")
        assert arm(tab) != before
