"""The pages of docs/reference/ that are made of what the program knows: `make reference`.

What the program shows of a thing stands beside it: a key's description in its model, an option's help in its parser.
Here is only how a page shows it; what only a page says, such as what a finding means, is in the templates.
"""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from docs.generate.commands import exit_codes, relay, the_commands
from docs.generate.facts import facts
from docs.generate.findings import findings, matching
from docs.generate.keys import of_file, of_group, of_model, of_topic, policies
from docs.generate.library import names
from docs.generate.metrics import metrics, scalars
from docs.generate.status import objects
from syncrelay.status.server import PATHS_TOLD
from syncrelay.sync import DropReason

_MANY_EMPTY_LINES: Final = re.compile(r"\n{3,}")
FOLDER: Final = Path(__file__).parents[1] / "reference"


def pages() -> Mapping[str, str]:
    """Return the texts of the pages by their file names."""
    known = {
        "file.md": {
            "of_file": of_file(),
            "of_group": of_group(),
            "of_topic": of_topic(),
            "of_model": of_model,
            "policies": policies(),
        },
        "findings.md": {"findings": findings(), "matching": matching()},
        "drop_reasons.md": {"reasons": tuple(DropReason)},
        "command_line.md": {
            "relay": relay(),
            "commands": the_commands(),
            "exit_codes": exit_codes(),
        },
        "status.md": {"objects": objects()},
        "facts.md": {"facts": facts()},
        "library.md": {"names": names()},
        "metrics.md": {"paths": PATHS_TOLD, "metrics": metrics(), "scalars": scalars()},
    }
    templates = Environment(
        loader=FileSystemLoader(Path(__file__).parent / "templates"),
        undefined=StrictUndefined,
        autoescape=False,  # noqa: S701  Markdown
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    texts = {name: templates.get_template(f"{name}.jinja").render(known[name]) for name in known}
    return {name: _MANY_EMPTY_LINES.sub("\n\n", text).rstrip() + "\n" for name, text in texts.items()}
