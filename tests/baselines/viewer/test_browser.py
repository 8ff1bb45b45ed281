"""The viewer in a real browser: names from files are shown letter by letter, and nothing in them runs."""

import pytest

import ikgym
from baselines.solvers.rivals.model_files import urdf
from baselines.viewer.replay import Stage
from baselines.viewer.session import Session
from tests.chromium import chromium

pytest.importorskip("viser")
from baselines.viewer import server as servers
from tests.baselines.viewer.conftest import HOST

#: Longest wait for a text of the page, in [ms].
READY = 60_000
#: Texts that set a variable of the page, or load something, if they are run or read as Markdown.
HOSTILE = (
    "{globalThis.ran = 1}",
    "\\\\{globalThis.ran = 1}",
    "`{globalThis.ran = 1}`",
    "<img src='x' onError={() => {globalThis.ran = 1}} />",
    "<img src='x' onerror='globalThis.ran = 1'>",
    "<script>globalThis.ran = 1</script>",
    "![x](http://127.0.0.1:9/x.png)",
    "a\n\nexport const ran = globalThis.ran = 1\n\nb",
)


@pytest.fixture(scope="module")
def browser(serving):
    del serving  # begins before playwright, and ends after it: both have a loop of their own
    with chromium() as made:
        yield made


def scenario_of(name, folder):
    """A scenario file of that name, with an arm of a URDF file whose joints have the name."""
    toml, quoted = folder / "it.toml", name.replace("&", "&amp;").replace("<", "&lt;").replace("\n", "&#10;")
    arm = ikgym.arms.get("panda")
    content = urdf(arm)
    for joint, usual in enumerate(arm.joint_names, 1):
        attribute = f"{quoted} {joint}".replace('"', "&quot;")
        content = content.replace(f'"{usual}"', f'"{attribute}"')
    (folder / "it.urdf").write_text(content)
    panda = ikgym.scenarios.get("panda-circle").replace(steps=2)
    panda.replace(name=name, arm=ikgym.arms.from_urdf(folder / "it.urdf")).save(toml)
    return ikgym.scenarios.load(toml)


@pytest.mark.parametrize("name", [HOSTILE[0], *(pytest.param(name, marks=pytest.mark.slow) for name in HOSTILE[1:])])
def test_names_are_shown_and_do_not_run(name, browser, server, tmp_path):
    stage = Stage.of(scenario_of(name, tmp_path))
    viewer = servers.Viewer(server, Session(stage, ["dls"]))
    viewer.session.place(stage.scenario.arm.upper)
    viewer.tick(1.0)  # the panel names the joint at its limit
    tab, errors, foreign = browser.new_page(), [], []
    tab.on("pageerror", lambda error: errors.append(str(error)))
    tab.on("request", lambda request: foreign.append(request.url))
    tab.goto(f"http://{HOST}:{server.get_port()}")
    for part in ("[rad]", ", seed 0", " is 0 rad from its limit"):
        tab.wait_for_function("text => document.body.innerText.includes(text)", arg=part, timeout=READY)
    assert tab.evaluate("globalThis.ran") is None
    text, line = tab.evaluate("document.body.innerText"), " ".join(name.split())
    for part in (f"{line}, seed 0", f"{line} 1 is 0 rad from its limit", f"{line} 7 [rad]"):
        assert part in text
    assert errors == []
    assert not [url for url in foreign if "127.0.0.1:9" in url or url.endswith("/x")]
    tab.close()
