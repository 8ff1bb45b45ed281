"""Arms: the frozen description of a serial chain, the arms of papers and of makers, and conversions from other forms.

>>> import ikgym
>>> ikgym.arms.get("varga7").joints
7
"""

from __future__ import annotations

from collections.abc import Callable

from ikgym.arms import (
    faitli,
    fetch,
    flexiv,
    franka,
    khan,
    kinova,
    kuka,
    pal,
    panda_calibrated,
    ufactory,
    varga,
    zhang,
)
from ikgym.arms.arm import Arm
from ikgym.arms.denavit_hartenberg import from_dh
from ikgym.arms.urdf import from_urdf
from ikgym.registry import Registry

__all__ = ["SHIPPED", "Arm", "from_dh", "from_urdf", "get", "names", "register"]

_registry: Registry[Arm] = Registry("arm", Arm)
for _family in (
    varga,
    faitli,
    khan,
    zhang,
    franka,
    panda_calibrated,
    kuka,
    kinova,
    ufactory,
    flexiv,
    pal,
    fetch,
):
    for _name, _make in _family.ARMS.items():
        _registry.register(_name, _make)
#: The arms of this package: what names one of them can be read by everyone.
SHIPPED = frozenset(_registry.names())


def get(name: str) -> Arm:
    """The arm of a name.

    Raises:
        UnknownNameError: There is no such arm; the message has the nearest name.
        InvalidInputError: What makes it fails, or makes something else.
    """
    return _registry.get(name)


def names() -> tuple[str, ...]:
    """The names of all arms."""
    return _registry.names()


def register(name: str, make: Callable[[], Arm]) -> None:
    """Adds an arm of your own.

    Args:
        name: Its new name.
        make: Called without arguments when the arm is first asked for.

    Raises:
        InvalidInputError: The name is taken or no text, or there is nothing that makes the arm.
    """
    _registry.register(name, make)
