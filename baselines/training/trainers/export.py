"""The agent that a run leaves: a model for Stable-Baselines3, and the same network for :mod:`baselines`."""

from __future__ import annotations

from typing import Any

from stable_baselines3.common.base_class import BaseAlgorithm

from baselines.agents.features import Processing
from baselines.agents.sb3_zip import export_model, save_zip
from baselines.training.folder import Folder
from ikgym.scenarios import Scenario


def export(
    model: BaseAlgorithm, folder: Folder, processing: Processing, scenario: Scenario, about: dict[str, Any]
) -> None:
    """Writes `model.zip` and `agent.safetensors`.

    Args:
        model: Whose actor the agent is.
        folder: Of the run.
        processing: What the agent sees, and what its answers mean.
        scenario: What it was trained on.
        about: The `run.json` of the run, of which the agent keeps how it was trained.

    Raises:
        ResultsError: A file cannot be written.
    """
    training = {name: about[name] for name in ("method", "seed", "training", "kept", "versions")}
    save_zip(model, folder.model, processing, scenario)
    export_model(model, folder.agent, processing, scenario, training)
