"""The page in a real browser: it loads without an error, sorts, filters, plays, and fits a telephone."""

import contextlib
import itertools
import shutil

import pytest

from baselines.evaluation.html import PAGE
from tests.baselines.evaluation.html.conftest import NASTY, nasty_policy

NAMES = ("chromium", "chromium-browser", "google-chrome")
#: Drawn by the processor, and quiet: no profile of somebody, no calls home.
FLAGS = (
    "--headless", "--no-sandbox", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--disable-gpu",
)  # fmt: skip
SOFTWARE = ("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
#: Nothing is drawn: that waits for the first frame, which never comes.
TABLE_ALONE = "globalThis.requestAnimationFrame = () => 0"
#: Of the first scenario; the other policy has privileged information.
THREE = ["dls", "moore_penrose", "dls:damping=0.05"]
#: The processor draws one scene in space, not three: the ticks of the others go before anything is drawn.
ONE_SCENE = """addEventListener("DOMContentLoaded", () => {
  for (const box of [...document.querySelectorAll("#results input:checked")].slice(1)) box.checked = false;
})"""
READY = 60_000


@pytest.fixture(scope="module")
def launch():
    """Starts a browser with more flags; there can be only one Playwright at a time."""
    sync_api = pytest.importorskip("playwright.sync_api", reason="no playwright: pip install 'ikgym[dev]'")
    found = next(filter(None, map(shutil.which, NAMES)), None)
    if found is None:
        pytest.skip(f"no browser: none of {', '.join(NAMES)} is installed")
    with sync_api.sync_playwright() as playwright:  # at its end, browsers end
        yield lambda *flags: playwright.chromium.launch(executable_path=found, args=[*FLAGS, *flags], timeout=READY)


@pytest.fixture(scope="module")
def flat(launch):
    """A browser without WebGL: quick where the processor would have to draw space."""
    return launch("--disable-3d-apis")


@contextlib.contextmanager
def opened(started, folder, *, width=1100, script=""):
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


def names_apart(tab):
    """How many names there are in the picture of costs, none of which hides another one."""
    boxes = tab.locator("#cost-time .textpoint").evaluate_all(
        """(texts) => texts.map((text) => text.getBoundingClientRect())
            .map((box) => [box.left, box.right, box.top, box.bottom])"""
    )
    for (left, right, top, bottom), other in itertools.combinations(boxes, 2):
        assert right <= other[0] or other[1] <= left or bottom <= other[2] or other[3] <= top
    return len(boxes)


def arm(tab):
    """Where the links of the first replay are."""
    return tab.evaluate("(() => { const { x, y } = PLAYER.scenes[0].plot.data[2]; return [...x, ...y]; })()")


def time(tab):
    return tab.evaluate("PLAYER.time")


def test_the_table_works_before_anything_is_drawn(flat, folder):
    with opened(flat, folder, script=TABLE_ALONE) as tab:
        sorts_and_filters(tab)
        assert tab.title().startswith(NASTY)


def drawn(tab):
    """Goes to the replay, with no control in focus, and waits until its scenes are there, at the time of the player."""
    tab.wait_for_selector("html[data-ready]")
    tab.locator("#replay .scene").first.scroll_into_view_if_needed()
    tab.evaluate("document.activeElement.blur()")
    here = "scene.inSight && scene.plot.data && scene.at === PLAYER.time"
    tab.wait_for_function(f"PLAYER.scenes.every((scene) => {here}) && !PLAYER.busy")


def first_paint(tab):
    """In [ms] from when the page was asked for."""
    tab.wait_for_function("performance.getEntriesByName('first-contentful-paint').length")
    return tab.evaluate("performance.getEntriesByName('first-contentful-paint')[0].startTime")


@pytest.fixture(scope="module")
def page(flat, folder):
    """The page, drawn; the tests below leave it as they find it."""
    with opened(flat, folder) as tab:
        drawn(tab)
        yield tab


@pytest.mark.slow
class TestDrawn:
    def test_it_draws_all_there_is(self, page):
        assert page.locator("#replay figcaption b").all_text_contents() == THREE
        for plot in ("cost-time", "errors", "joints"):
            assert page.locator(f"#{plot} .main-svg").count() > 0
        assert page.evaluate("document.getElementById('joints').data.length") == 7 * 3
        note = page.locator("#replay-note").text_content()
        assert "thinned to 400 of 450 steps" in note
        assert "no WebGL" in note
        assert page.evaluate("PLAYER.scenes.map((scene) => scene.plot.data[0].type)") == ["scatter"] * 3
        assert page.get_by_label("View").is_hidden()

    def test_it_sorts_and_filters(self, page):
        sorts_and_filters(page)

    def test_it_plays_and_pauses(self, page):
        drawn(page)
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

    def test_the_last_of_many_places_is_shown(self, page):
        drawn(page)
        page.evaluate("for (let k = 0; k <= 40; k += 1) seek(PLAYER.end * k / 40)")
        drawn(page)
        last = page.evaluate("row(array(PLAYER.scenes[0].entry, 'nominal'), 399)")
        assert page.evaluate("PLAYER.scenes[0].plot.data[5].y[0]") == page.evaluate(f"placed([{last}]).y[0]")

    def test_keys_play_and_go_by_pictures(self, page):
        drawn(page)
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
        page.locator("#play").focus()
        page.keyboard.press("Home")
        page.wait_for_function("PLAYER.time === 0")
        page.keyboard.press("Space")
        page.wait_for_function("PLAYER.playing")
        page.keyboard.press("Space")
        assert not page.evaluate("PLAYER.playing")
        page.get_by_label("Filter").focus()
        page.keyboard.press("Space")
        assert page.get_by_label("Filter").input_value() == " "  # where one writes, it is a letter
        assert not page.evaluate("PLAYER.playing")
        page.get_by_label("Filter").fill("")

    def test_joints_at_a_limit_are_coloured_and_said(self, page):
        drawn(page)
        entry = "PLAYER.scenes[0].entry"
        held = page.evaluate(f"array({entry}, 'limit').values.findIndex((state) => state > 0)")
        row, joint = divmod(held, 7)
        page.evaluate(f"seek(array({entry}, 'time').values[{row}])")
        drawn(page)
        colours = page.evaluate("PLAYER.scenes[0].plot.data[3].marker.color")
        names = page.evaluate("['joint', 'acceleration', 'velocity', 'stop'].map(themed)")
        assert colours[joint] in names[1:]
        assert f"joint {joint + 1} at its" in page.locator("#replay figcaption span").first.text_content()

    def test_the_choice_is_that_of_the_ticks(self, page):
        box = page.get_by_label(f"{THREE[-1]} in {NASTY}: show in the pictures")
        box.uncheck()
        page.wait_for_function("PLAYER.scenes.length === 2")
        assert page.locator("#replay figcaption b").all_text_contents() == THREE[:2]
        assert page.evaluate("document.getElementById('errors').data.length") == 2 * 2
        box.check()
        page.wait_for_function("PLAYER.scenes.length === 3")
        drawn(page)


@pytest.mark.slow
def test_it_fits_400_pixels(flat, folder):
    with opened(flat, folder, width=400) as tab:
        drawn_here = "PLAYER.scenes.map((scene) => Boolean(scene.plot.data))"
        tab.wait_for_selector("html[data-ready]")
        assert tab.evaluate(drawn_here) == [False] * 3  # not before one sees them
        tab.keyboard.press("Space")
        assert not tab.evaluate("PLAYER.playing")  # this key scrolls where there is no replay
        tab.keyboard.press("Home")
        tab.locator("#replay .scene").first.scroll_into_view_if_needed()
        tab.wait_for_function(f"{drawn_here}[0] && PLAYER.scenes[0].inSight && !PLAYER.busy")
        assert not tab.evaluate(drawn_here)[2]
        assert tab.evaluate("document.documentElement.scrollWidth") == 400
        for name in ("#play", "#time", "#filter", "#cost-time", "#joints", "#replay figure >> nth=0"):
            box = tab.locator(name).bounding_box()
            assert box["x"] >= 0
            assert box["x"] + box["width"] <= 400
        before = arm(tab)
        tab.get_by_role("button", name="Play").click()
        tab.wait_for_function("PLAYER.time > 0.05")
        assert arm(tab) != before


@pytest.mark.slow
def test_space_is_drawn_moves_and_turns(launch, folder):
    with opened(launch(*SOFTWARE), folder, width=400, script=ONE_SCENE) as tab:
        drawn(tab)
        assert tab.evaluate("WEBGL")
        assert tab.locator("#replay canvas").count() >= 1
        before = arm(tab)
        tab.keyboard.press("End")
        drawn(tab)
        assert arm(tab) != before
        tab.get_by_label("View").select_option("side")
        tab.wait_for_function("PLAYER.scenes[0].plot._fullLayout.scene.camera.eye.y > 1")
        tab.wait_for_function("PLAYER.scenes[0].plot._fullLayout.scene.camera.eye.x === 0")


@pytest.mark.slow
def test_pages_are_seen_soon(flat, folder, full_folder):
    for where, most in ((folder, 2000), (full_folder, 3000)):
        times = []
        for _ in range(3):  # the machine may have other work
            with opened(flat, where, script=TABLE_ALONE) as tab:
                times.append(first_paint(tab))
            if min(times) < most:
                break
        assert min(times) < most


@pytest.mark.slow
def test_a_full_page_is_drawn_and_names_stay_names(flat, full_folder):
    with opened(flat, full_folder) as tab:
        drawn(tab)
        assert set(column(tab, "policy")) == {nasty_policy(number) for number in range(25)}
        (name,) = set(tab.locator("#replay figcaption b").all_text_contents()[:1])
        assert name in tab.locator("#cost-time .textpoint").all_text_contents()
        assert 3 <= names_apart(tab) < 25
        assert name in tab.locator("#errors .legendtext").all_text_contents()
        tab.locator("#cost-time .point").first.hover(force=True)
        seen = tab.locator("#cost-time .hovertext").text_content()
        assert any(nasty_policy(number) in seen for number in range(25))
        tab.locator("#episodes summary").click()
        tab.wait_for_function("document.querySelectorAll('#episodes tr').length === 501")
        assert "The first 500 of 6400" in tab.locator("#episodes-note").text_content()
