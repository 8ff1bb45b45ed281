"""Models of Stable-Baselines3 as agents, and agents from models: ``pip install "ikgym[train]"``.

The only file here that needs a learning library, and loaded only where one of its files is.
"""

from __future__ import annotations

import hashlib
import io
import json
import math
import pathlib
import warnings
import zipfile
from collections.abc import Mapping
from typing import Any, Final

import gymnasium
import numpy as np
import numpy.typing as npt

from baselines.agents.features import Features, Processing
from baselines.agents.files import check_described, check_format, description, save_agent
from baselines.agents.network import Network
from baselines.agents.protocols import AgentFile, Transform
from baselines.agents.raw import ORDER, RawObservation
from baselines.agents.sb3_network import network_of
from baselines.agents.untrusted import check_trust, parse_json, read, refuse
from baselines.files import write
from baselines.files.archives import ArchiveError, packed, unpacked
from baselines.policy import Problem
from ikgym.exceptions import InvalidInputError, MissingDependencyError
from ikgym.scenarios import Scenario

try:
    from stable_baselines3.common.base_class import BaseAlgorithm
    from stable_baselines3.common.save_util import load_from_zip_file
except ImportError as error:
    raise MissingDependencyError('.zip files of agents need Stable-Baselines3: pip install "ikgym[train]"') from error

#: The member of a .zip that says what an agent sees: JSON of ours, which Stable-Baselines3 passes over.
MEMBER: Final = "ikgym.json"

#: How many network outputs are compared after an export, and how near they have to be.
_COMPARED, _NEAR = 64, 1e-5


def load_zip(
    file: pathlib.Path, problem: Problem, *, trust: bool = False, offsets: tuple[int, ...] | None = None
) -> AgentFile:
    """The agent in a model that Stable-Baselines3 saved.

    Stable-Baselines3 loads it, which runs whatever code is in the file: nothing is read without trust.

    What the model sees is what :func:`save_zip` has written into it. Without that it is taken to be the observation
    itself, as `MultiInputPolicy` sees it, or `MlpPolicy` behind Gymnasium's `FlattenObservation`. How many steps ahead
    that shows follows from the number of inputs, but not which ones: 1, 2, … unless `offsets` says otherwise. Whatever
    else stood between the environment and the model, such as `VecNormalize`, is not in the file and so not here.

    Args:
        file: The .zip.
        problem: What the agent is told of the scenario.
        trust: Whether the file may run code. Any model will do that has no memory.
        offsets: Steps ahead at which the model sees the nominal coordinates, where the file does not say so itself.

    Raises:
        ResultsError: There is no such file, it is damaged, or not trusted.
        InvalidInputError: The model does not suit the scenario, or offsets are not asked for or do not fit.
    """
    check_trust(file, trust=trust)
    source, content = str(file), read(file)
    try:
        members = unpacked(content)
    except ArchiveError as e:
        refuse(source, f"is damaged, or no .zip file: {e}")
    described = members.get(MEMBER)
    about: dict[str, Any] = {}
    processing: Transform | None = None
    if described is not None:
        about = parse_json(source, described)
        check_format(source, about)
        processing = check_described(source, about)
        if offsets is not None:
            raise InvalidInputError(f"offsets: {file} says itself what it sees, got {offsets}.")
    network = _loaded(source, packed(members))  # not the file, whose directory may claim whatever it likes
    if processing is None:
        try:
            processing = RawObservation.of_size(network.inputs, problem, offsets)
        except InvalidInputError as e:
            raise InvalidInputError(f"Agent {source}: {e}") from None
    return AgentFile(source, network, processing, about, hashlib.sha256(content).hexdigest())


def save_zip(model: BaseAlgorithm, file: pathlib.Path, processing: Processing, scenario: Scenario) -> None:
    """Saves a model with what it sees, in one go, as :func:`load_zip` and Stable-Baselines3 itself read it.

    Args:
        model: Trained on the features of `processing`.
        file: Where to.
        processing: What the model sees, and what its outputs mean.
        scenario: What it was trained on.

    Raises:
        ResultsError: The file cannot be written.
    """
    content = io.BytesIO()
    model.save(content)
    with zipfile.ZipFile(content, "a") as archive:
        archive.writestr(MEMBER, json.dumps(description(processing, scenario, {}), ensure_ascii=False))
    write(file, content.getvalue())


def export_model(
    model: BaseAlgorithm,
    file: pathlib.Path,
    processing: Processing,
    scenario: Scenario,
    training: Mapping[str, Any] | None = None,
) -> str:
    """Writes a model as an agent that needs no learning library, see :func:`baselines.agents.files.save_agent`.

    Args:
        model: Trained on the features of `processing`: PPO, A2C, SAC, TD3 or DDPG with a multi-layer perceptron.
        file: Where to; usually ``NAME.safetensors``.
        processing: What the model sees, and what its outputs mean.
        scenario: What it was trained on.
        training: How, in whatever JSON can say.

    Returns:
        The agent's hash.

    Raises:
        InvalidInputError: The model is another, sees something else, or acts otherwise than its network.
        ResultsError: The file cannot be written.
    """
    network = network_of_model(model.policy, model.policy_kwargs)
    shape, needed = (network.inputs, network.outputs), (processing.size(Problem.of(scenario)), scenario.joints)
    if shape != needed:
        raise InvalidInputError(
            f"model: expected one from {needed[0]} features to {needed[1]} joints, got {shape[0]} and {shape[1]}."
        )
    features = np.random.default_rng(0).normal(0.0, 3.0, (_COMPARED, shape[0])).astype(np.float32)
    outputs, _ = model.predict(features, deterministic=True)
    if not np.abs(outputs - network.forward(features)).max() <= _NEAR:
        raise InvalidInputError("model: its tensors make up another network than the one that acts.")
    return save_agent(file, network, processing, scenario, training)


def network_of_model(policy: Any, arguments: Mapping[str, Any]) -> Network:
    """The actor of a model, see :func:`baselines.agents.sb3_network.network_of`.

    Args:
        policy: The policy of the model.
        arguments: Its `policy_kwargs`.

    Raises:
        InvalidInputError: It is no multi-layer perceptron, or one that has more to it than its tensors show.
    """
    texts = {name: str(value) if isinstance(value, type) else value for name, value in arguments.items()}
    state = {name: tensor.detach().cpu().numpy() for name, tensor in policy.state_dict().items()}
    return network_of(state, texts)


class TrustedModel:
    """The policy of a model, as Stable-Baselines3 loads it.

    Args:
        policy: Its policy.

    Raises:
        InvalidInputError: It sees or does something else than an agent, or has a memory.
    """

    def __init__(self, policy: Any) -> None:
        self._policy = policy
        space = policy.observation_space
        spaces = dict(space.spaces) if isinstance(space, gymnasium.spaces.Dict) else {"": space}
        if tuple(spaces) not in (ORDER, ("",)):
            raise InvalidInputError(f"expected an observation of the parts {ORDER}, got {tuple(spaces)}")
        if not all(isinstance(part, gymnasium.spaces.Box) for part in (*spaces.values(), policy.action_space)):
            raise InvalidInputError(f"expected boxes, got {space} and {policy.action_space}")
        self._flat = "" in spaces
        self._shapes: dict[str, tuple[int, ...]] = {name: part.shape or () for name, part in spaces.items()}
        self.inputs = sum(math.prod(shape) for shape in self._shapes.values())
        self.outputs = math.prod(policy.action_space.shape)
        zeros = np.zeros((1, self.inputs), dtype=np.float32)
        action, state = policy.predict(self._observation(zeros[0]), deterministic=True)
        if state is not None or np.shape(action) != (self.outputs,) or np.asarray(action).dtype.kind != "f":
            raise InvalidInputError("expected a model without a memory, whose actions are numbers")

    def forward(self, features: Features) -> npt.NDArray[np.float32]:
        """The model's actions, one row at a time: a matrix product of torch may round otherwise in a batch."""
        out = np.empty((len(features), self.outputs), dtype=np.float32)
        for row, numbers in enumerate(features):
            out[row], _ = self._policy.predict(self._observation(numbers), deterministic=True)
        return out

    def _observation(self, numbers: Features) -> Any:
        """What the model expects, from one row of features."""
        out, begin = {}, 0
        for name, shape in self._shapes.items():
            end = begin + math.prod(shape)
            out[name], begin = numbers[begin:end].reshape(shape), end
        return out[""] if self._flat else out


def _loaded(source: str, content: bytes) -> TrustedModel:
    """Loads a model as Stable-Baselines3 does; its code runs."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of versions that differ, and schedules that no prediction needs
        try:
            data, parameters, _ = load_from_zip_file(io.BytesIO(content), device="cpu")
            if data is None or "policy" not in parameters:
                raise ValueError("it holds no policy")
            # Policies of TD3 and DDPG know no `use_sde`, and it is never true for them.
            arguments = ({"use_sde": True} if data.get("use_sde") else {}) | data["policy_kwargs"]
            spaces = data["observation_space"], data["action_space"]
            policy = data["policy_class"](*spaces, lambda _: 0.0, **arguments)
            policy.load_state_dict(parameters["policy"])
            return TrustedModel(policy)
        except Exception as e:  # whatever the code of others raises
            refuse(source, f"cannot be loaded by Stable-Baselines3: {type(e).__name__}: {e}")
