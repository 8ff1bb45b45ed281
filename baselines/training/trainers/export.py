"""What a run leaves: an agent for :mod:`baselines`, and where there are critics, the model for Stable-Baselines3."""

from __future__ import annotations

from typing import Any

from stable_baselines3.common.base_class import BaseAlgorithm

from baselines.agents.features import Processing
from baselines.agents.files import save_agent
from baselines.agents.recurrent.files import save_recurrent
from baselines.agents.recurrent.processing import Recurrent
from baselines.agents.sb3_zip import save_zip
from baselines.training.config.base import Activation
from baselines.training.folder import Folder
from baselines.training.networks import MemoryModel
from baselines.training.trainer import Trainer
from baselines.training.trainers.model_file import actor_network, save_model
from ikgym.scenarios import Scenario


def export(trainer: Trainer, activation: Activation, folder: Folder, scenario: Scenario, about: dict[str, Any]) -> None:
    """Writes `agent.safetensors`; of a model of Stable-Baselines3 `model.zip` and `model.safetensors`, too.

    Args:
        trainer: Whose model is written.
        activation: Of the hidden layers.
        folder: Of the run.
        scenario: What the agent was trained on.
        about: The `run.json` of the run, of which the agent keeps how it was trained.

    Raises:
        ResultsError: A file cannot be written.
    """
    model, processing = trainer.model, trainer.processing
    training = {name: about[name] for name in ("method", "seed", "training", "kept", "versions")}
    if isinstance(model, MemoryModel):
        assert isinstance(processing, Recurrent)
        save_recurrent(folder.agent, model.policy.to_runtime(), processing, scenario, training)
        return
    assert not isinstance(processing, Recurrent)
    if isinstance(model, BaseAlgorithm) and isinstance(processing, Processing):
        save_zip(model, folder.zip, processing, scenario)
        save_model(model, folder.model, activation, processing, scenario)
    save_agent(folder.agent, actor_network(model, activation), processing, scenario, training)
