"""Files of identified plants, as ``ikgym identify`` writes them."""

from __future__ import annotations

import dataclasses
import os
from typing import Annotated, Any, Self

from ikgym.arms import Arm
from ikgym.exceptions import InvalidInputError
from ikgym.files import read_user_toml
from ikgym.frozen import Frozen
from ikgym.plant.checks import PerJoint, joint_numbers
from ikgym.plant.plant import Plant
from ikgym.validation import Positive, add_location, different_texts, known_names, shorten

#: Control periods may differ by this share: that of a log is measured.
ALIKE = 0.01


@dataclasses.dataclass(frozen=True)
class IdentifiedPlant(Frozen):
    """A plant that was identified from a log of an arm.

    Args:
        arm: The name of the arm.
        joints: The names of its joints.
        period: The control period in [s], to which delays and drives of low order belong.
        plant: The plant.
        delay: Delay of each joint in periods, before a lag of first order in continuous time.
        time_constant: T of that lag in [s].

    Raises:
        InvalidInputError: A value is no such thing.
    """

    arm: str
    joints: Annotated[tuple[str, ...], different_texts]
    period: Positive
    plant: Plant
    delay: Annotated[PerJoint, joint_numbers] = 0.0
    time_constant: Annotated[PerJoint, joint_numbers] = 0.0

    @classmethod
    def load(cls, file: str | os.PathLike[str]) -> Self:
        """The identified plant in a file.

        Raises:
            InvalidInputError: The file cannot be read, or a value is no such thing.
            UnknownNameError: There is no such key.
        """
        table = read_user_toml(file)
        with add_location("", file):
            known_names("key", table, ("arm", "joints", "period", "plant", "drives"))
            missing = [key for key in ("arm", "joints", "period", "plant") if key not in table]
            if missing:
                raise InvalidInputError(f"{missing[0]}: expected a file that ikgym identify wrote, got no such key.")
            plant, drives = _table(table, "plant"), _table(table, "drives")
            known_names("key of [plant]", plant, [field.name for field in dataclasses.fields(Plant)])
            known_names("key of [drives]", drives, ("delay", "time_constant"))
            return cls(table["arm"], table["joints"], table["period"], Plant(**plant), **drives)

    def plant_for(self, arm: Arm, period: float) -> Plant:
        """The plant, for a scenario's arm and its Δt in [s].

        Raises:
            InvalidInputError: It was identified on another arm, or at another control period.
        """
        if (arm.name, tuple(arm.joint_names)) != (self.arm, self.joints):
            raise InvalidInputError(
                f"plant: expected one of arm {arm.name!r} with the joints {', '.join(arm.joint_names)}, got one "
                f"that was identified on {self.arm!r} with {', '.join(self.joints)}."
            )
        if abs(period - self.period) > ALIKE * period:
            raise InvalidInputError(
                f"plant: expected one for a control period of {1e3 * period:g} ms, got one that was identified at "
                f"{1e3 * self.period:g} ms."
            )
        return self.plant


def _table(table: dict[str, Any], key: str) -> dict[str, Any]:
    found = table.get(key, {})
    if not isinstance(found, dict):
        raise InvalidInputError(f"{key}: expected a table, got {shorten(found)}.")
    return found
