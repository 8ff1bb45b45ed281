"""Writes `balls.json`: where the ball at the end of five calibrated Pandas was, by those who calibrated them.

    git clone https://github.com/platonics-delft/kinematics_calibration   # MIT
    python -m tests.arms.golden.write_balls kinematics_calibration

A line an arm: the centre of the ball in the frame of the flange, eight recorded postures with the ball in one socket,
and, where they published them, the positions of the ball that their own program calculated from these postures.
"""

import json
import re
import sys
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

FILE = Path(__file__).parent / "balls.json"
#: A recording of each arm.
RECORDINGS = {2: "back_left", 3: "frontcenter", 4: "front", 6: "front", 7: "front"}
POSTURES = 8


def record(folder: Path, number: int) -> dict[str, object]:
    """What is known of the ball of one arm."""
    urdf = ElementTree.parse(folder / f"calibrated_urdf/panda_{number}/panda.urdf")
    shifts = {name: _numbers(urdf, name, "xyz") for name in ("panda_hand_joint", "panda_hand_tcp_joint", "ball_joint")}
    yaw = _numbers(urdf, "panda_hand_joint", "rpy")[2]
    turn = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
    ball = shifts["panda_hand_joint"] + turn @ (shifts["panda_hand_tcp_joint"] + shifts["ball_joint"])
    csv = folder / f"data/panda_{number}/{RECORDINGS[number]}/hole_0.csv"
    out: dict[str, object] = {"ball": ball.tolist(), "q": np.loadtxt(csv, delimiter=",")[:POSTURES].tolist()}
    published = folder / f"calibrated_urdf/panda_{number}/kpis.yaml"
    if published.exists():
        rows = published.read_text().split("fks_1:")[1].split("fks_2:")[0]
        out["published"] = np.array(re.findall(r"-?\d\.\d+(?:e-\d+)?", rows), float).reshape(-1, 3)[:POSTURES].tolist()
    return out


def _numbers(urdf: ElementTree.ElementTree, joint: str, key: str) -> np.ndarray:
    origin = urdf.find(f"joint[@name='{joint}']/origin")
    return np.array(origin.get(key).split(), dtype=float)


if __name__ == "__main__":
    lines = [f'"panda-{i}": {json.dumps(record(Path(sys.argv[1]), i))}' for i in RECORDINGS]
    FILE.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")
