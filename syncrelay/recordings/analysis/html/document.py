"""The page: words and tables from a template that escapes all it is given, drawings from data that is no script."""

import hashlib
from base64 import b64encode
from datetime import UTC, datetime
from functools import cache
from importlib.resources import files
from typing import Any, Final

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

from syncrelay.config.wording import counted
from syncrelay.errors import BagError
from syncrelay.explain import words
from syncrelay.printable import printable, printable_lines
from syncrelay.recordings.analysis import Analysis, file_with_changes
from syncrelay.recordings.analysis.html.drawings import drawings_of
from syncrelay.recordings.analysis.html.words import TOPIC_COLUMNS, group_words, topic_row
from syncrelay.recordings.analysis.report_text import sampled_line, size_text, slop_text
from syncrelay.status.fates import FATES

MARK: Final = '<meta name="generator" content="syncrelay">'
"""Stands near the begin of every page, and in no other file."""

_PACKAGE: Final = "syncrelay.recordings.analysis.html"
_STYLES: Final = ("uplot/uPlot.min.css", "../../../status/page/colours.css", "page/report.css")
_SCRIPTS: Final = ("uplot/uPlot.iife.min.js", "page/unpack.js", "page/plots.js", "page/lanes.js", "page/report.js")
# Up to 10 characters each: below 6 MB, however long the recording.
_MOST_MESSAGES: Final = 500_000


def as_html(name: str, analysis: Analysis) -> str:
    """Return the page."""
    most = _MOST_MESSAGES // max(1, len(analysis.groups))
    drawings = [drawings_of(group, analysis, most=most) for group in analysis.groups]
    told = [group_words(group, drawing) for group, drawing in zip(analysis.groups, drawings, strict=True)]
    script, style = _joined(_SCRIPTS), _joined(_STYLES)
    page: str = _template("report.html.jinja").render(
        mark=MARK,
        name=printable(name),
        began=_when(analysis.begin),
        lasts=words.seconds(analysis.end - analysis.begin),
        messages=counted(sum(topic.messages for topic in analysis.topics), "message"),
        faults=list(map(printable, analysis.faults)),
        topics=[topic_row(topic) for topic in analysis.topics],
        columns=TOPIC_COLUMNS,
        groups=told,
        counted=counted,
        duration=words.duration,
        seconds=words.seconds,
        sampled_line=sampled_line,
        size_text=size_text,
        slop_text=slop_text,
        fates={fate.name: fate for fate in FATES},
        drawings={
            "fates": [
                {"name": fate.name, "word": fate.word, "path": fate.path, "filled": fate.is_filled} for fate in FATES
            ],
            "groups": [each.for_script for each in drawings],
        },
        file=_file(analysis),
        script=script,
        style=style,
        script_hash=_content_hash(script),
        style_hash=_content_hash(style),
    )
    return page


def _file(analysis: Analysis) -> str:
    try:
        return printable_lines(file_with_changes(analysis.text, analysis.changes)).rstrip()
    except BagError as error:
        return f"# {error}"


@cache
def _template(name: str) -> Any:
    """Return a template. It escapes all it is given, as recordings come from strangers, and refuses unknown names."""
    environment = Environment(
        loader=PackageLoader(_PACKAGE, "page"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["coded"] = _coded
    return environment.get_template(name)


def _joined(names: tuple[str, ...]) -> str:
    folder = files(_PACKAGE)
    return "\n" + "\n".join(folder.joinpath(name).read_text(encoding="utf-8").strip() for name in names) + "\n"


def _content_hash(text: str) -> str:
    """Return the hash by which the page's Content-Security-Policy admits a style or a script."""
    return f"sha256-{b64encode(hashlib.sha256(text.encode()).digest()).decode('ascii')}"


def _when(nanoseconds: int) -> str:
    try:
        return f"{datetime.fromtimestamp(nanoseconds / 1_000_000_000, tz=UTC):%Y-%m-%d %H:%M:%S} UTC"
    except (OverflowError, ValueError):
        return f"{nanoseconds} ns"


def _coded(text: str) -> Markup:
    """Return a sentence, escaped, with what stands between backticks as code."""
    parts = text.split("`")
    wrapped = (Markup("<code>{}</code>").format(part) if at % 2 else escape(part) for at, part in enumerate(parts))
    return Markup("").join(wrapped)
