"""The command ``ikgym view``: solvers side by side in a browser, live and in an episode."""

from __future__ import annotations

import dataclasses
import pathlib
import sys
from typing import Annotated, Any

import tyro

from baselines.cli import shell
from baselines.cli.parsing import EpisodeOptions, if_random
from baselines.viewer.replay import Stage
from baselines.viewer.session import Session
from ikgym.arms import Arm
from ikgym.exceptions import InvalidInputError


@dataclasses.dataclass(frozen=True, kw_only=True)
class Options(EpisodeOptions):
    """Options of the command."""

    urdf: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="FILE")] = None
    """A URDF file of the arm with meshes. If left out, the file that the arm was read from, else cylinders."""
    host: Annotated[str, tyro.conf.arg(metavar="HOST")] = "127.0.0.1"
    """Address to listen on; with 0.0.0.0, users of other machines can connect and move the arms."""
    port: Annotated[int, tyro.conf.arg(metavar="PORT")] = 8080
    """Port to listen on; 0 for a free one."""


RULES = (if_random("--seed"),)


def manual(prog: str) -> str:
    """The text of ``--help`` above the options."""
    return f"""\
Shows policies side by side in a browser: a replay of the episode at any speed, and arms that follow a target that you
drag, each with a policy, without the imperfections of the scenario's plant. Sliders move the joints within their
limits. Needs pip install "ikgym[view]".

Examples:
  {prog} --scenario panda-circle --policy qp rhc
  {prog} --scenario varga7-random --seed 2000000 --policy mfac rhc_foresight
  {prog} --scenario lab.toml --policy qp --urdf lab.urdf"""


def _work(options: Options, _: str) -> None:
    # Before episodes are played: extras may be missing, or the port taken.
    from baselines.viewer.server import Viewer, free_port, serving

    port = free_port(options.host, options.port)
    stage = Stage.of(options.scenario, options.seed, options.steps)
    shapes = meshes(stage.scenario.arm, options.urdf)
    session = Session(stage, options.policies(stage.scenario))
    with serving(options.host, port) as server:
        viewer = Viewer(server, session, shapes)
        print(f"http://{server.get_host()}:{server.get_port()}  (Ctrl-C ends it)", flush=True)
        viewer.run()


def meshes(arm: Arm, file: pathlib.Path | None) -> Any:
    """The meshes in a URDF file, else in the one that the arm was read from; None for cylinders."""
    source = arm.urdf.file if file is None and arm.urdf is not None else file
    if source is None:
        return None
    from baselines.viewer.meshes import read_urdf

    try:
        return read_urdf(source, arm)
    except InvalidInputError as e:
        if file is not None:
            raise
        print(f"Cylinders are shown: {e}", file=sys.stderr)
        return None


main = shell.Command("view", Options, manual, _work, RULES)
