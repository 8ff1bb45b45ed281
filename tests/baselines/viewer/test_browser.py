"""The viewer in a real browser: names from files are shown letter by letter, and nothing in them runs.

Without a browser, :mod:`tests.baselines.evaluation.test_report` has them read by a parser of Markdown.
"""

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


def scenario_of(names, folder):
    """A scenario file of the first name, with an arm of a URDF file whose joints have the others."""
    toml, arm = folder / "it.toml", ikgym.arms.get("panda")
    content = urdf(arm)
    for name, usual in zip(names[1:], arm.joint_names, strict=True):
        quoted = name.replace("&", "&amp;").replace("<", "&lt;").replace("\n", "&#10;").replace('"', "&quot;")
        content = content.replace(f'"{usual}"', f'"{quoted}"')
    (folder / "it.urdf").write_text(content)
    panda = ikgym.scenarios.get("panda-circle").replace(steps=2)
    panda.replace(name=names[0], arm=ikgym.arms.from_urdf(folder / "it.urdf")).save(toml)
    return ikgym.scenarios.load(toml)


@pytest.mark.slow
def test_names_are_shown_and_do_not_run(serving, tmp_path):
    stage = Stage.of(scenario_of(HOSTILE, tmp_path))
    viewer = servers.Viewer(serving, Session(stage, ["dls"]))
    viewer.session.place(stage.scenario.arm.upper)
    viewer.tick(1.0)  # the panel names the joint at its limit
    errors, foreign = [], []
    with chromium() as browser:  # begins after the server, and ends before it: each has an event loop
        tab = browser.new_page()
        tab.on("pageerror", lambda error: errors.append(str(error)))
        tab.on("request", lambda request: foreign.append(request.url))
        tab.goto(f"http://{HOST}:{serving.get_port()}")
        for part in ("[rad]", ", seed 0", " is 0 rad from its limit"):
            tab.wait_for_function("text => document.body.innerText.includes(text)", arg=part, timeout=READY)
        assert tab.evaluate("globalThis.ran") is None
        text = tab.evaluate("document.body.innerText")
    scenario, *joints = (" ".join(name.split()) for name in HOSTILE)
    for part in (f"{scenario}, seed 0", f"{joints[0]} is 0 rad from its limit", *(f"{one} [rad]" for one in joints)):
        assert part in text
    assert errors == []
    assert not [url for url in foreign if "127.0.0.1:9" in url or url.endswith("/x")]
