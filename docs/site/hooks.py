"""Hooks of MkDocs: generated pages, and links out of the folder of the pages."""

from __future__ import annotations

import re
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

from docs.site import notebooks, reference, replay

ROOT = Path(__file__).parents[2]
#: Pages that GitHub wants at the root, by their names on the site.
AT_THE_ROOT = {"contributing.md": "CONTRIBUTING.md", "changelog.md": "CHANGELOG.md"}


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Adds what is generated."""
    pages = notebooks.pages(Path(config.docs_dir))
    pages |= {f"reference/{name}.md": reference.api(name) for name in reference.PAGES}
    pages["reference/commands.md"] = reference.commands()
    for name, source in AT_THE_ROOT.items():
        pages[name] = (ROOT / source).read_text(encoding="utf-8").replace("](docs/", "](")
    for name, text in pages.items():
        files.append(File.generated(config, name, content=text))
    if report := replay.file(config):
        files.append(report)
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Leads links to pages at the root, and to notebooks, to where the site has them, and shows the replay."""
    markdown = replay.place_report(markdown, there=replay.PAGE in files.src_uris)
    if page.is_homepage:
        page.meta["hide"] = ["navigation"]  # it would be empty
    up = "../" * page.file.src_uri.count("/")
    for name, source in AT_THE_ROOT.items():
        markdown = re.sub(rf"\]\((?:\.\./)+{re.escape(source)}", f"]({up}{name}", markdown)
    return re.sub(r"\]\((\S+)\.ipynb\)", r"](\1.md)", markdown)
