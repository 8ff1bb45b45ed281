"""The report of ``make demo`` on the landing page, where there is one: the arms move in it."""

from __future__ import annotations

import logging
import re
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File

#: Its name on the site.
PAGE = "replay.html"
#: Where the replay begins in it.
PART = "replay-head"

_PLACE = re.compile(r"<!-- replay -->\n.*?<!-- end -->", re.DOTALL)
# An address with #PART would scroll the landing page as well. Pictures above need a moment for their height. From disk
# browsers keep frames apart, and the report stays at its top, the table.
_AT_THE_PART = f"""\
const page = contentDocument, part = page?.getElementById('{PART}');
setTimeout(() => page?.defaultView.scrollBy(0, part?.getBoundingClientRect().top ?? 0), 1000)"""
_SHOWN = f"""\
<iframe src="{PAGE}" title="Report of make demo: table, pictures and replay" loading="lazy" onload="{_AT_THE_PART}"
style="width: 100%; height: 40rem; border: 1px solid; border-radius: 0.2rem"></iframe>

[Open the report by itself]({PAGE})"""
_ABSENT = "*This copy of the site was built without it.*"

_log = logging.getLogger(f"mkdocs.{__name__}")


def file(config: MkDocsConfig) -> File | None:
    """The report as a file of the site; None, and a line in the log, where there is none."""
    report = Path(config.config_file_path).parent / config.extra["report"]
    if not report.is_file():
        _log.info(f"no {config.extra['report']}: the landing page is without a replay; make demo writes it")
        return None
    return File.generated(config, PAGE, abs_src_path=str(report))


def place_report(markdown: str, *, there: bool) -> str:
    """A page that shows the report where it is to be, or says that it is not there."""
    return _PLACE.sub(lambda found: f"{found[0]}\n\n{_SHOWN if there else _ABSENT}", markdown)
