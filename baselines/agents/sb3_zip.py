"""Models of Stable-Baselines3 as agents, and agents from models: ``pip install "ikgym[train]"``.

The only file here that needs a learning library, and loaded only where one of its files is.
"""

from __future__ import annotations

import hashlib
import io
import json
import math
import pathlib
import re
import warnings
import zipfile
from collections.abc import Mapping
from typing import Any, Final

import gymnasium
import numpy as np
import numpy.typing as npt

from baselines.agents.features import Features, Processing
from baselines.agents.files import check_described, check_format, description, parse_json, read, refuse, save_agent
from baselines.agents.parts import AgentFile, Answers, Sees
from baselines.agents.raw import ORDER, RawObservation
from baselines.agents.sb3_network import network_of
from baselines.files import write
from baselines.policy import Problem
from ikgym.exceptions import IkgymError, InvalidInputError, MissingDependencyError
from ikgym.scenarios import Scenario

try:
    import torch
    from stable_baselines3.common.base_class import BaseAlgorithm
    from stable_baselines3.common.save_util import load_from_zip_file
except ImportError as error:
    raise MissingDependencyError('.zip files of agents need Stable-Baselines3: pip install "ikgym[train]"') from error

#: The member of a .zip that says what an agent sees: JSON of ours, which Stable-Baselines3 passes over.
MEMBER: Final = "ikgym.json"

# Most bytes of members, once unpacked; and of tensors.
_MOST: Final = {"data": 2**24, "policy.pth": 2**28, MEMBER: 2**20}
_MOST_NUMBERS: Final = 2**26
#: The oldest torch whose weights-only reading is not known to run code.
_SAFE_TORCH: Final = (2, 6)
#: How many answers are compared after an export, and how near they have to be.
_COMPARED, _NEAR = 64, 1e-5

_TRUST = " With --trust, or trust=True, Stable-Baselines3 loads it, and runs whatever code is in it."


def load_zip(
    file: pathlib.Path, problem: Problem, *, trust: bool = False, offsets: tuple[int, ...] | None = None
) -> AgentFile:
    """The agent in a model that Stable-Baselines3 saved.

    Without trust nothing in the file is run. Tensors are read by torch's weights-only reader. From `data` come plain
    texts, such as how Python printed the activation's class; what is serialised there is never unpacked. That does for
    multi-layer perceptrons of PPO, A2C, SAC, TD3 and DDPG.

    What the model sees is what :func:`save_zip` has written into it. Without that it is taken to be the observation
    itself, as `MultiInputPolicy` sees it, or `MlpPolicy` behind Gymnasium's `FlattenObservation`. How many steps ahead
    that shows follows from the number of inputs, but not which ones: 1, 2, … unless `offsets` says otherwise. Whatever
    else stood between the environment and the model, such as `VecNormalize`, is not in the file and so not here.

    Args:
        file: The .zip.
        problem: What the agent is told of the scenario.
        trust: Whether the file may run code: Stable-Baselines3 loads it then, and any model will do that has no memory.
        offsets: Steps ahead at which the model sees the nominal coordinates, where the file does not say so itself.

    Raises:
        ResultsError: There is no such file, it is damaged, or cannot be rebuilt without being trusted.
        InvalidInputError: The model does not suit the scenario, or offsets are not asked for or do not fit.
    """
    source, content = str(file), read(file)
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            members = {name: _member(source, archive, name) for name in _MOST if name in archive.namelist()}
    except IkgymError:
        raise
    except Exception as e:  # whatever a file of unknown origin makes the reader raise
        refuse(source, f"is damaged, or no .zip file: {e}")
    if missing := sorted({"data", "policy.pth"} - set(members)):
        refuse(source, f"is no model of Stable-Baselines3: it lacks {', '.join(missing)}")
    about: dict[str, Any] = {}
    processing: Sees | None = None
    if MEMBER in members:
        about = parse_json(source, members[MEMBER])
        check_format(source, about)
        processing = check_described(source, about)
        if offsets is not None:
            raise InvalidInputError(f"offsets: {file} says itself what it sees, got {offsets}.")
    network: Answers = _trusted(source, content) if trust else _rebuilt(source, members)
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
        processing: What the model sees, and what its answers mean.
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
        processing: What the model sees, and what its answers mean.
        scenario: What it was trained on.
        training: How, in whatever JSON can say.

    Returns:
        The agent's hash.

    Raises:
        InvalidInputError: The model is another, sees something else, or answers otherwise than its network.
        ResultsError: The file cannot be written.
    """
    # As they stand in the file of a model, where classes are texts.
    arguments = {name: str(value) if isinstance(value, type) else value for name, value in model.policy_kwargs.items()}
    state = {name: tensor.detach().cpu().numpy() for name, tensor in model.policy.state_dict().items()}
    network = network_of(state, arguments)
    shape, needed = (network.inputs, network.outputs), (processing.size(Problem.of(scenario)), scenario.joints)
    if shape != needed:
        raise InvalidInputError(
            f"model: expected one from {needed[0]} features to {needed[1]} joints, got {shape[0]} and {shape[1]}."
        )
    features = np.random.default_rng(0).normal(0.0, 3.0, (_COMPARED, shape[0])).astype(np.float32)
    answers, _ = model.predict(features, deterministic=True)
    if not np.abs(answers - network.answer(features)).max() <= _NEAR:
        raise InvalidInputError("model: its tensors make up another network than the one that answers.")
    return save_agent(file, network, processing, scenario, training)


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

    def answer(self, features: Features) -> npt.NDArray[np.float32]:
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


def _member(source: str, archive: zipfile.ZipFile, name: str) -> bytes:
    """A member of an archive that is not too large."""
    size = archive.getinfo(name).file_size
    if size > _MOST[name]:
        refuse(source, f"has a member {name!r} that is too large: expected at most {_MOST[name]} bytes, got {size}")
    with archive.open(name) as stream:  # gives no more than the size that it claims
        return stream.read()


def _trusted(source: str, content: bytes) -> TrustedModel:
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


def _rebuilt(source: str, members: Mapping[str, bytes]) -> Answers:
    """The network of a model, of which nothing is run."""
    data = parse_json(source, members["data"])
    try:
        _check_plain(data)
        arguments = data.get("policy_kwargs")
        if not isinstance(arguments, dict):
            raise InvalidInputError(f"policy_kwargs: expected an object, got {arguments!r}")
        plain = {name: value for name, value in arguments.items() if not name.startswith(":")}
        return network_of(_tensors(source, members["policy.pth"]), plain)
    except InvalidInputError as e:
        refuse(source, f"cannot be rebuilt without running what is in it: {e}", _TRUST)


def _check_plain(data: Mapping[str, Any]) -> None:
    """Refuses models that are not what their tensors alone would say."""
    home = _field(data, "policy_class", "__module__")
    if not re.fullmatch(r"stable_baselines3\.(common|sac|td3|ppo|a2c|ddpg)\.policies", home):
        raise InvalidInputError(f"policy_class: expected one of Stable-Baselines3's own, got one of {home!r}")
    kind = _field(data, "observation_space", ":type:")
    if kind == "<class 'gymnasium.spaces.dict.Dict'>":
        parts = re.findall(r"'(\w+)': \w+\(", _field(data, "observation_space", "spaces"))
        if tuple(parts) != ORDER:
            raise InvalidInputError(f"observation_space: expected the parts {ORDER}, got {tuple(parts)}")
    elif kind != "<class 'gymnasium.spaces.box.Box'>":
        raise InvalidInputError(f"observation_space: expected a Box, or a Dict of them, got {kind}")
    for bound, value in (("low", -1.0), ("high", 1.0)):
        text = _field(data, "action_space", bound)
        numbers = re.findall(r"[-+.\w]+", text)
        if not numbers or any(number.rstrip(".") != f"{value:g}" for number in numbers):
            raise InvalidInputError(f"action_space: expected the bounds -1 and 1, got {bound} = {text}")


def _field(data: Mapping[str, Any], name: str, field: str) -> str:
    """A text that stands beside something serialised."""
    beside = data.get(name)
    text = beside.get(field) if isinstance(beside, dict) else None
    if not isinstance(text, str):
        raise InvalidInputError(f"{name}: expected a text {field!r}, got {type(text).__name__}")
    return text


def _tensors(source: str, content: bytes) -> dict[str, npt.NDArray[Any]]:
    """The tensors of a model, read by torch's weights-only reader."""
    if tuple(int(number) for number in re.findall(r"\d+", torch.__version__)[:2]) < _SAFE_TORCH:
        refuse(
            source,
            f"cannot be read safely by torch {torch.__version__}: expected {'.'.join(map(str, _SAFE_TORCH))} or newer",
        )
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            size = sum(member.file_size for member in archive.infolist())
        if size > _MOST["policy.pth"]:
            refuse(source, f"has tensors that are too large: expected at most {_MOST['policy.pth']} bytes, got {size}")
        state = torch.load(io.BytesIO(content), map_location="cpu", weights_only=True)
    except IkgymError:
        raise
    except Exception as e:  # whatever a file of unknown origin makes the reader raise
        first = next(iter(str(e).splitlines()), "")
        raise InvalidInputError(f"policy.pth: expected tensors only, got {type(e).__name__}: {first}") from None
    if not isinstance(state, dict) or not all(isinstance(name, str) for name in state):
        raise InvalidInputError(f"policy.pth: expected tensors by name, got {type(state).__name__}")
    for name, tensor in state.items():
        if (
            type(tensor) is not torch.Tensor
            or tensor.layout is not torch.strided
            or tensor.device.type != "cpu"
            or tensor.dtype not in (torch.float32, torch.float64)
            or tensor.numel() > _MOST_NUMBERS
        ):
            kind = f"{tensor.dtype} of shape {tuple(tensor.shape)}" if hasattr(tensor, "dtype") else repr(type(tensor))
            raise InvalidInputError(f"policy.pth: expected {name!r} to be an array of numbers, got {kind}")
    return {name: tensor.numpy() for name, tensor in state.items()}
