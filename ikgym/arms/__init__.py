"""Arms: the frozen description of a serial chain, the arms of papers and of makers, and conversions from other forms.

>>> import ikgym
>>> ikgym.arms.get("varga7").joints
7
"""

from __future__ import annotations

from collections.abc import Callable

from ikgym.arms import catalogue
from ikgym.arms.arm import Arm
from ikgym.arms.bodies import Bodies
from ikgym.arms.denavit_hartenberg import from_dh
from ikgym.arms.urdf import Tip, from_urdf, tips
from ikgym.registry import Registry

__all__ = ["SHIPPED", "Arm", "Bodies", "Tip", "from_dh", "from_urdf", "get", "names", "register", "tips"]

_registry: Registry[Arm] = Registry("arm", Arm)
for _name, _make in catalogue.read().items():
    _registry.register(_name, _make)
#: The arms of this package, which files may refer to by name.
SHIPPED = frozenset(_registry.names())


def get(name: str) -> Arm:
    """The arm of a name.

    Raises:
        UnknownNameError: There is no such arm; the message has the nearest name.
        InvalidInputError: The registered function fails, or does not return an arm.
    """
    return _registry.get(name)


def names() -> tuple[str, ...]:
    """The names of all arms."""
    return _registry.names()


def register(name: str, make: Callable[[], Arm]) -> None:
    """Adds an arm of your own.

    Args:
        name: Its new name.
        make: Returns the arm; called without arguments when the arm is first needed.

    Raises:
        InvalidInputError: The name is taken or no text, or `make` cannot be called.
    """
    _registry.register(name, make)
