"""Holds the files of a submission against what it says of them, and makes an entry of the leaderboard of them."""

from __future__ import annotations

import dataclasses
import hashlib
import importlib
import pathlib
import sys
from collections.abc import Mapping, Sequence
from typing import Any, Self

from baselines import registry
from baselines.agents import untrusted
from baselines.agents.policy import Agent
from baselines.evaluation.pages.entries import TIMED, Entry, Training
from baselines.evaluation.pages.measure import plan
from baselines.evaluation.pages.submissions.manifest import FILE, Manifest, Part
from baselines.files import ResultsError, write
from ikgym.preview import furthest


@dataclasses.dataclass(frozen=True)
class Submission:
    """A folder whose files are what it says.

    Args:
        folder: Where it lies.
        manifest: What it says of itself.
    """

    folder: pathlib.Path
    manifest: Manifest

    @property
    def digest(self) -> str:
        """The first twelve digits of the SHA-256 of all digests, in the order of the parts."""
        together = "".join(part.sha256 for part in self.manifest.parts)
        return hashlib.sha256(together.encode()).hexdigest()[:12]

    @property
    def runs_code(self) -> bool:
        """Whether to play it runs code of the folder in this process."""
        return any(pathlib.PurePath(part.file).suffix != untrusted.SUFFIX for part in self.manifest.parts)

    def copied(self, to: pathlib.Path) -> Self:
        """The same in another folder, where nothing but the files that it names can be found.

        What is scored is just what the digest is of: neither bytecode beside a module, nor what is exchanged later.

        Raises:
            ResultsError: A file is not what the folder says any more, or the copy cannot be written.
        """
        for part in self.manifest.parts:
            write(to / part.file, _checked(self.folder, part))
        return dataclasses.replace(self, folder=to.absolute())

    def entry(self, *, timed: bool) -> Entry:
        """As the leaderboard plays it. Modules are imported now: only of a folder that is trusted.

        Args:
            timed: Whether its calls are timed.

        Raises:
            ResultsError: A module cannot be imported, has no such policy, or its policy has privileged information.
        """
        own, training = self.manifest, None
        if own.method is not None:
            steps = tuple(part.steps or 0 for part in own.parts)
            training = Training(
                own.method, own.base_policy, steps, tuple(part.core_minutes or 0.0 for part in own.parts)
            )
        seeds = tuple(part.seed for part in own.parts if part.seed is not None)
        variants = tuple(self._variant(part) for part in own.parts)
        return Entry(own.name, variants, seeds, training=training, timed=TIMED if timed else 0)

    def _variant(self, part: Part) -> tuple[str, Mapping[str, Any]]:
        file = self.folder / part.file
        if part.policy is None:
            trust = {"trust": True} if file.suffix == untrusted.ZIP else {}
            return "agent", {"path": str(file), **trust, **part.parameters}
        place = f"{_module(file)}:{part.policy}"
        found = registry.load(place)
        if getattr(found, "reference", False):
            raise ResultsError(f"{file}: {part.policy} has privileged information, and references are not ranked.")
        return place, part.parameters


def submission(folder: pathlib.Path, *, trust: bool) -> Submission:
    """Checks a folder; nothing of it is run.

    Args:
        folder: Where it lies.
        trust: Whether its code may be run, later.

    Raises:
        ResultsError: A file is missing, damaged, or not what the folder says; or code is in it that nobody trusts.
    """
    found = Submission(folder.absolute(), Manifest.read(folder))
    for part in found.manifest.parts:
        _checked(folder, part)
        if given := [name for name in Agent.decisive if name in part.parameters]:
            raise ResultsError(
                f"{folder / FILE}: expected no {given[0]!r} among the parameters: the file of an agent is that whose "
                "digest is checked, and trust is given on the command line, never by a file."
            )
    if found.runs_code and not trust:
        named = [part.file for part in found.manifest.parts if not part.file.endswith(untrusted.SUFFIX)]
        raise ResultsError(
            f"{folder}: {named[0]} runs code of its own in this process. With --trust it is loaded: only for folders "
            "whose maker you know. An agent as .safetensors needs no trust."
        )
    return found


def check_foresight(entry: Entry, name: str, episodes: int, declared: int) -> None:
    """Insists that a policy is shown what was declared.

    Args:
        entry: Of the submission.
        name: Of a test set or scenario.
        episodes: That are played there.
        declared: Steps ahead.

    Raises:
        ResultsError: It is shown something else.
        IkgymError: It cannot be made, or does not suit the scenario.
    """
    jobs = [job for some in plan(name, [entry], episodes).values() for job in some]
    if not jobs:
        raise ResultsError(f"{entry.name} plays no episode of {name}: made for another task or arm.")
    shown = max(furthest(job.preview) for job in jobs)
    if shown != declared:
        raise ResultsError(
            f"{entry.name} declares a foresight of {declared} steps, and its policy is shown {shown} in {name}."
        )


def _checked(folder: pathlib.Path, part: Part) -> bytes:
    """What is in a file of the folder: the bytes that should be."""
    file, kinds = folder / part.file, (untrusted.SUFFIX, untrusted.ZIP, ".py")
    if file.resolve().parent != folder.resolve():
        raise ResultsError(f"{folder / FILE}: expected files of the folder itself, got {part.file!r}.")
    if file.suffix not in kinds:
        raise ResultsError(f"{folder / FILE}: expected a file of the kind {', '.join(kinds)}, got {part.file!r}.")
    # Also says which file may have been meant, and refuses one that is too large for an agent.
    content = untrusted.read(file)
    digest = hashlib.sha256(content).hexdigest()
    if digest != part.sha256:
        raise ResultsError(f"{file}: expected the sha256 {part.sha256} of {FILE}, got {digest}.")
    return content


def _module(file: pathlib.Path) -> str:
    """The name by which a module of the folder can be imported, here and in processes of this machine."""
    if not file.stem.isidentifier():
        raise ResultsError(f"{file}: expected the name of a module in Python, got {file.stem!r}.")
    folder = str(file.parent.resolve())
    if folder not in sys.path:
        sys.path.append(folder)
        importlib.invalidate_caches()
    try:
        found = importlib.import_module(file.stem)
    except (Exception, SystemExit) as e:  # whatever the module of somebody else raises
        raise ResultsError(f"{file}: cannot be imported: {type(e).__name__}: {e}.") from e
    if pathlib.Path(found.__file__ or "").resolve() != file.resolve():
        raise ResultsError(f"{file}: there is another module of the name {file.stem!r}: choose one of its own.")
    return file.stem


def taken(entry: str, lines: Sequence[str]) -> bool:
    """Whether a name belongs to somebody else already."""
    return entry in lines or registry.known(entry.partition(":")[0].partition(",")[0])
