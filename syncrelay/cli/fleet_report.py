"""What `analyze --into` tells when all recordings are done: the report of all, as text, JSON or a page."""

import json
from dataclasses import dataclass
from pathlib import Path

from syncrelay.cli.boundary import DONE, put
from syncrelay.cli.fleet_json import fleet_as_json
from syncrelay.cli.fleet_text import fleet_lines
from syncrelay.cli.new_file import write_again
from syncrelay.recordings.fleet.documents import documents_in
from syncrelay.recordings.fleet.ledger import State, read_ledger
from syncrelay.recordings.fleet.report import Failure, fleet_report


@dataclass(frozen=True, slots=True)
class Views:
    """How the report is told: a page where one is named, JSON or text. `robot` says where in a path its name is."""

    html: str | None
    json: bool
    robot: str | None


def tell_report(folder: Path, views: Views) -> int:
    """Tell of all recordings that a folder has analyses of; 0. Raises UsageError for a pattern that is none."""
    failed = [Failure(entry.recording[0], entry.error) for entry in read_ledger(folder) if entry.state is State.FAILED]
    report = fleet_report(documents_in(folder), robot=views.robot, failed=failed)
    if views.html is not None:
        from syncrelay.cli.fleet_html.document import fleet_as_html
        from syncrelay.cli.pages import MARK

        write_again(views.html, fleet_as_html(report), mark=MARK)
    if views.json:
        put(json.dumps(fleet_as_json(report), indent=2))
        return DONE
    for line in fleet_lines(report):
        put(line)
    return DONE
