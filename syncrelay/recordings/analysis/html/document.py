"""The page: words and tables from a template that escapes all it is given, drawings from data that is no script."""

from typing import Any, Final

from syncrelay.errors import BagError
from syncrelay.explain import words
from syncrelay.printable import printable, printable_lines
from syncrelay.recordings.analysis import Analysis, file_with_changes
from syncrelay.recordings.analysis.html.drawings import drawings_of
from syncrelay.recordings.analysis.html.words import TopicRow, group_words, topic_row
from syncrelay.recordings.pages import MARK, content_hash, joined, template, when
from syncrelay.status.fates import FATES, Fate

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
    script, style = joined(_PACKAGE, _SCRIPTS), joined(_PACKAGE, _STYLES)
    page: str = template(_PACKAGE, "report.html.jinja").render(
        mark=MARK,
        name=printable(name),
        began=when(analysis.begin),
        lasts=words.seconds(analysis.end - analysis.begin),
        messages=sum(topic.messages for topic in analysis.topics),
        faults=list(map(printable, analysis.faults)),
        topics=[topic_row(topic) for topic in analysis.topics],
        columns=TopicRow.COLUMNS,
        groups=told,
        fates={fate.name: fate for fate in FATES},
        drawings={"fates": [_fate(fate) for fate in FATES], "groups": [each.for_script for each in drawings]},
        file=_file(analysis),
        script=script,
        style=style,
        script_hash=content_hash(script),
        style_hash=content_hash(style),
    )
    return page


def _file(analysis: Analysis) -> str:
    try:
        return printable_lines(file_with_changes(analysis.text, analysis.changes)).rstrip()
    except BagError as error:
        return f"# {error}"


def _fate(fate: Fate) -> dict[str, Any]:
    return {"name": fate.name, "word": fate.word, "path": fate.path, "filled": fate.is_filled}
