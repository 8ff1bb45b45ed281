"""A page as tests read it: by the standard library, which knows nothing of how it was written."""

from __future__ import annotations

import html.parser
import json
import pathlib
from typing import Any

from baselines.evaluation.machine import describe
from baselines.evaluation.plan import EvaluationPlan
from baselines.evaluation.results import Results

VOID = {"meta", "link", "input", "br"}


class Page(html.parser.HTMLParser):
    """The elements of a page, and the texts in them.

    Args:
        text: The page.
    """

    def __init__(self, text: str) -> None:
        super().__init__(convert_charrefs=True)
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.texts: dict[str, str] = {}
        self.cells: list[list[tuple[dict[str, str | None], str]]] = []
        self.open: list[str] = []
        self.unbalanced: list[str] = []
        self._id = ""
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: Any) -> None:
        attributes = dict(attrs)
        self.elements.append((tag, attributes))
        if tag == "tr":
            self.cells.append([])
        if tag in ("td", "th"):
            self.cells[-1].append((attributes, ""))
        if tag not in VOID:
            self.open.append(tag)
        if tag in ("script", "title", "h1", "style"):
            self._id = attributes.get("id") or tag

    def handle_endtag(self, tag: str) -> None:
        if not self.open or self.open.pop() != tag:
            self.unbalanced.append(tag)
        self._id = ""

    def handle_data(self, text: str) -> None:
        if self._id:
            self.texts[self._id] = self.texts.get(self._id, "") + text
        elif self.open and self.open[-1] in ("td", "th", "button") and self.cells and self.cells[-1]:
            attributes, before = self.cells[-1][-1]
            self.cells[-1][-1] = attributes, before + text

    @property
    def data(self) -> dict[str, Any]:
        """What the scripts read."""

        def refuse(constant: str) -> None:
            raise AssertionError(f"{constant} is no JSON")

        content: dict[str, Any] = json.loads(self.texts["data"], parse_constant=refuse)
        return content

    def lines(self) -> list[dict[str, tuple[str | None, str]]]:
        """The lines of the table: sort value and text of each cell by the head of its column."""
        heads, *lines = self.cells
        names = [text for _, text in heads]
        return [
            {name: (attributes.get("data-value"), text) for name, (attributes, text) in zip(names, line, strict=True)}
            for line in lines
        ]


def results_of(folder: pathlib.Path) -> Results:
    """What is in a folder of results, from whatever it was."""
    return Results(folder, EvaluationPlan((), ()), describe(), resume=True)
