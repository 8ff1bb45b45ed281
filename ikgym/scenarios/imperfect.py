"""The scenario `panda-field` at other severities of its plant."""

from __future__ import annotations

from ikgym import scenarios
from ikgym.plant import Plant

#: The scenario, and the severity of its plant.
FIELD_NAME, SEVERITY = "panda-field", 0.5
#: All scenarios with an imperfect plant, and `panda-ideal`, on the same paths.
SCENARIOS = scenarios.names("plants")
#: The plant at severity 1: calibration error, payload half-way, slow camera, lag and delay.
FIELD = Plant(
    zero=1e-3,
    link=6e-4,
    axis=1e-3,
    payload=1e-3,
    payload_step=1500,
    bandwidth=(10.0, 20.0),
    command_delay=(2, 12),
    pose_noise=1e-3,
    pose_rotation_noise=1e-3,
    pose_every=33,
    pose_missing=0.2,
)


def field(knowledge: float = SEVERITY, drives: float | None = None) -> scenarios.Scenario:
    """`panda-field` at other severities.

    Args:
        knowledge: Severity of calibration error, payload and camera, see :meth:`ikgym.Plant.scaled`; 0 is ideal.
        drives: Severity of lag and delay; that of the knowledge by default.
    """
    return scenarios.get(FIELD_NAME).replace(plant=FIELD.scaled(knowledge, drives))
