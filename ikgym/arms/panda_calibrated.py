"""Five Pandas as they are: the kinematics that were measured on single arms.

From `platonics-delft/kinematics_calibration` (MIT, Franzese, Spahn and Ramirez 2024), whose method, MUKCa, puts a ball
at the end of the arm into two sockets 50 mm apart in many postures, and finds the chain that sees it in one place.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from ikgym.arms.arm import Arm
from ikgym.arms.franka import PANDA, READY
from ikgym.arms.home import from_home
from ikgym.rotations import rodrigues

# Where each joint is in the frame of the joint before, as in the calibrated URDF files: x y z in [m], then roll, pitch
# and yaw in [rad]. The joint turns about the z axis of its frame. Rounded to 1e-9.
ORIGINS = {
    "panda-2": """
        0 0 0.333 0.000008367 0.000000088 0
        -0.000194176 -0.000187721 0 -1.572534711 0.000925504 0
        0.000337103 -0.316265057 -0.00018772 1.572048748 0.000112716 0.000818981
        0.082504287 -0.00028472 0.000265568 1.574143476 0.011776708 -0.000090252
        -0.078669418 0.384939075 0.000283829 -1.569359417 0.005129172 -0.010228055
        0.000653745 -0.000012755 0.00097864 1.570525887 -0.000435335 0.00511448
        0.090249365 -0.000895182 0.000016363 1.570720879 0.000000026 0.000515494
    """,
    "panda-3": """
        0 0 0.333 0.000001443 -0.000000011 0
        -0.000302724 0.000131439 0 -1.56922452 0.000259531 0
        0.000280659 -0.315981092 0.000131439 1.56995192 0.000177212 0.000170843
        0.082177251 -0.000053577 -0.000018749 1.570329239 0.003634168 -0.000172648
        -0.081661843 0.38416879 0.000053624 -1.57043337 0.001455818 -0.003298471
        -0.000048597 0.000429323 0.000171573 1.567932496 0.000152083 0.001454621
        0.087706497 -0.000963021 -0.0004289 1.57091825 -0.000000022 -0.000063172
    """,
    "panda-4": """
        0 0 0.333 -0.000006478 0.000000033 0
        0.000068698 0.000196884 0 -1.569103924 0.000467799 0
        0.000044999 -0.316819811 0.000196883 1.569905109 -0.002670264 0.000453579
        0.082654273 0.000203664 0.000820006 1.569139483 0.001392739 0.002653867
        -0.082041344 0.384753404 -0.000201895 -1.571699378 0.011030878 -0.001150063
        0.000806929 0.000693043 0.000754109 1.565906533 0.00244728 0.011031932
        0.087896234 -0.001311888 -0.000680396 1.569037177 -0.000003415 -0.002277927
    """,
    "panda-6": """
        0 0 0.333 -0.000002631 -0.000000052 0
        -0.000165423 0.00046612 0 -1.567163123 -0.000606391 0
        -0.000040187 -0.316507073 0.000466117 1.567543445 0.007116874 -0.000593695
        0.082984335 -0.000811617 0.000508609 1.572016489 0.001378946 -0.007051884
        -0.082508299 0.384583428 0.000807559 -1.569984004 0.003846076 -0.001325397
        -0.000151575 0.000359249 0.000584072 1.566825116 0.002949001 0.003845001
        0.086203607 -0.001640476 -0.000357509 1.571805286 0.000003402 -0.002789393
    """,
    "panda-7": """
        0 0 0.333 -0.000020356 -0.000000003 0
        -0.000148054 -0.000619169 0 -1.566371709 0.000923842 0.000000001
        0.000318125 -0.316834125 -0.000619165 1.571244857 0.000367542 0.000823325
        0.081998314 0.000195722 0.000834664 1.568597544 0.001732403 -0.000384058
        -0.082040156 0.384715761 -0.000193694 -1.570603329 0.01148658 -0.00149762
        0.000933376 0.000030712 0.000716412 1.567657122 0.002087244 0.011486287
        0.088651293 -0.001405177 -0.000017729 1.573414736 0.00000566 -0.0019275
    """,
}
FLANGE = np.array([0, 0, 0.107])


def calibrated(name: str) -> Arm:
    """A measured Panda from `panda_link0` to its flange, with the limits of the nominal one.

    Measured were positions of the ball, 0.13 m beyond the flange. Over all recordings of an arm they scatter by 0.26 to
    0.54 mm about the socket (root mean square), and by 3.6 to 10.7 mm with the nominal kinematics. What turns the
    flange and leaves the ball where it is was not measured.
    """
    rotation, position = np.eye(3), np.zeros(3)
    axes, points = np.empty((7, 3)), np.empty((7, 3))
    x, y, z = np.eye(3)
    for i, origin in enumerate(np.array(ORIGINS[name].split(), dtype=float).reshape(7, 6)):
        position = position + rotation @ origin[:3]
        roll, pitch, yaw = origin[3:]
        rotation = rotation @ rodrigues(z, yaw) @ rodrigues(y, pitch) @ rodrigues(x, roll)
        axes[i], points[i] = rotation[:, 2], position
    return from_home(name, axes, points, 7 * (False,), rotation, position + rotation @ FLANGE, **PANDA).replace(
        home=READY
    )


ARMS = {name: partial(calibrated, name) for name in ORIGINS}
