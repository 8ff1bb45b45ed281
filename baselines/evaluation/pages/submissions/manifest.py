"""What a submission says of itself: its ``submission.toml``, read and checked, without running anything of it."""

from __future__ import annotations

import dataclasses
import difflib
import pathlib
import re
import tomllib
from typing import Any, Final, Self

from baselines.files import ResultsError, json_files, read_bytes
from ikgym.scenarios import SPLITS

#: The file that says what a folder holds.
FILE: Final = "submission.toml"
#: Bytes of it that are read at most.
MOST: Final = 2**16
#: Names, and lines of text: they stand in tables, where these signs would mean something.
NAME: Final = re.compile(r"[\w][\w .+-]{0,59}")
LINE: Final = re.compile(r"[^`|<>\[\]]{1,200}")
COMMAND: Final = re.compile(r"[^`]{1,400}")
DIGEST: Final = re.compile(r"[0-9a-f]{64}")


@dataclasses.dataclass(frozen=True)
class Part:
    """A file of the folder: the agent of a training seed, or the module of a policy.

    Args:
        file: Its name within the folder.
        sha256: Of its bytes, in 64 hexadecimal digits.
        seed: The training seed, or that of the policy; None where there is none.
        policy: In a module: the name of the class.
        parameters: That the policy is made with.
        steps: What the training of this seed has cost: steps of the environment, or samples.
        core_minutes: Likewise: minutes times cores.
    """

    file: str
    sha256: str
    seed: int | None = None
    policy: str | None = None
    parameters: dict[str, Any] = dataclasses.field(default_factory=dict)
    steps: int | None = None
    core_minutes: float | None = None


@dataclasses.dataclass(frozen=True)
class Manifest:
    """What a submission says of itself.

    Args:
        name: What the leaderboard calls it.
        authors: Who made it.
        commands: What it was made with, from the data to the files.
        foresight: How many steps ahead the policy looks; 0 for none but the present one.
        tuned_on: The splits on which anything was trained or chosen.
        parts: Agents of several training seeds, or modules.
        method: How it was trained; None for what was not.
        base_policy: Of a residual agent.
    """

    name: str
    authors: tuple[str, ...]
    commands: tuple[str, ...]
    foresight: int
    tuned_on: tuple[str, ...]
    parts: tuple[Part, ...]
    method: str | None = None
    base_policy: str | None = None

    @classmethod
    def read(cls, folder: pathlib.Path) -> Self:
        """The manifest of a folder.

        Raises:
            ResultsError: There is none, it is damaged, or says something that the rules do not allow.
        """
        file = folder / FILE
        try:
            content = tomllib.loads(read_bytes(file, MOST).decode())
        except FileNotFoundError:
            raise ResultsError(
                f"{folder}: expected a file {FILE} that says what was submitted{_near(folder)}"
            ) from None
        except OSError as e:
            raise ResultsError(f"Cannot read {file}: {e.strerror}.") from None
        except ValueError as e:  # too large, not UTF-8, or no TOML
            raise ResultsError(f"{file} is damaged: {e}.") from None
        try:
            found = json_files.made(cls, content)
        except ValueError as e:
            raise ResultsError(f"{file}: {e}.{_hint(content)}") from None
        if wrong := found.wrong():
            raise ResultsError(f"{file}: {wrong}.")
        return found

    def wrong(self) -> str | None:
        """What is against the rules, of all that needs no look at the files; None where nothing is."""
        texts = [("name", NAME, (self.name,)), ("authors", LINE, self.authors), ("commands", COMMAND, self.commands)]
        texts.append(("method, base_policy", LINE, tuple(filter(None, (self.method, self.base_policy)))))
        for key, pattern, values in texts:
            if key in {"authors", "commands"} and not values:
                return f"{key}: expected at least one, got none"
            if bad := [value for value in values if not (pattern.fullmatch(value) and value.isprintable())]:
                return f"{key}: expected one line of plain text, got {json_files.shown(bad[0])}"
        if self.foresight < 0:
            return f"foresight: expected at least 0 steps, got {self.foresight}"
        allowed = [name for name in SPLITS if name != "test"]
        if bad := [split for split in self.tuned_on if split not in allowed]:
            return f"tuned_on: expected some of {', '.join(allowed)}, got {bad[0]!r}; test episodes are not tuned on"
        return self._wrong_parts()

    def _wrong_parts(self) -> str | None:
        if not self.parts:
            return "parts: expected an agent file or a module, got none"
        for part in self.parts:
            if not DIGEST.fullmatch(part.sha256):
                return f"{part.file}: expected a sha256 of 64 hexadecimal digits, got {json_files.shown(part.sha256)}"
            if (pathlib.PurePath(part.file).suffix == ".py") != (part.policy is not None):
                return (
                    f"{part.file}: expected the key policy, the name of a class, for a module (.py), and for no other"
                )
            if self.method is not None and (part.seed is None or part.steps is None or part.core_minutes is None):
                return f"{part.file}: expected seed, steps and core_minutes, since it was trained by {self.method}"
            if min(part.seed or 0, part.steps or 0, part.core_minutes or 0) < 0:
                return f"{part.file}: expected seed, steps and core_minutes of at least 0"
        seeds = [part.seed for part in self.parts]
        if len(set(seeds)) < len(seeds) or (len(seeds) > 1 and None in seeds):
            return "parts: expected a seed of its own for each"
        return None


def _near(folder: pathlib.Path) -> str:
    """The hint at what may have been meant."""
    if not folder.is_dir():
        return "; there is no such folder."
    near = difflib.get_close_matches(FILE, [file.name for file in folder.iterdir()], n=1, cutoff=0.5)
    return f". Did you mean {near[0]!r}?" if near else "."


def _hint(content: dict[str, Any]) -> str:
    """The nearest key to one that nothing has."""
    known = [field.name for kind in (Manifest, Part) for field in dataclasses.fields(kind)]
    parts = content.get("parts")
    given = {
        *content,
        *(key for part in (parts if isinstance(parts, list) else []) if isinstance(part, dict) for key in part),
    }
    for key in sorted(given - set(known)):
        if near := difflib.get_close_matches(key, known, n=1, cutoff=0.5):
            return f" Did you mean {near[0]!r}?"
    return ""
