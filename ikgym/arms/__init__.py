"""Arms: the frozen description of a serial chain, the arms of papers and of makers, and conversions from other forms.

>>> import ikgym
>>> ikgym.arms.get("varga7").joints
7
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from ikgym.arms import catalogue
from ikgym.arms.arm import Arm
from ikgym.arms.bodies import Bodies
from ikgym.registry import Registry

if TYPE_CHECKING:
    from ikgym.arms.denavit_hartenberg import from_dh
    from ikgym.arms.urdf import Tip, from_urdf, tips

__all__ = ["SHIPPED", "Arm", "Bodies", "Tip", "from_dh", "from_urdf", "get", "names", "register", "tips"]

_registry: Registry[Arm] = Registry("arm", Arm)
for _name, _make in catalogue.read().items():
    _registry.register(_name, _make)
#: The arms of this package, which files may refer to by name.
SHIPPED = frozenset(_registry.names())
# Conversions, imported when they are first used, and their modules.
_CONVERSIONS = {"from_dh": "denavit_hartenberg", "Tip": "urdf", "from_urdf": "urdf", "tips": "urdf"}


def __getattr__(name: str) -> Any:
    if name in _CONVERSIONS:
        return getattr(importlib.import_module(f"{__name__}.{_CONVERSIONS[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


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
    """Adds an arm.

    Args:
        name: Its new name.
        make: Returns the arm; called without arguments when the arm is first needed.

    Raises:
        InvalidInputError: The name is taken or no text, or `make` cannot be called.
    """
    _registry.register(name, make)
