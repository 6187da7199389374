"""configs/grafana.json and its queries."""

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

DASHBOARD: Final[dict[str, Any]] = json.loads((Path(__file__).parents[1] / "configs" / "grafana.json").read_text())
TARGETS: Final = [(panel, target) for panel in DASHBOARD["panels"] for target in panel["targets"]]
EXPRESSIONS: Final = [
    *(target["expr"] for _, target in TARGETS),
    *(each["expr"] for each in DASHBOARD["annotations"]["list"]),
]
MATCHERS: Final = re.compile(r"(\w+)\{([^}]*)\}")
_MATCHER = re.compile(r"(\w+)(?:=|!=|=~|!~)\"[^\"]*\"")


def series(expression: str) -> Iterator[tuple[str, set[str]]]:
    """The name of each series in a query, with the labels that select it."""
    for name, matchers in MATCHERS.findall(expression):
        labels = [_MATCHER.fullmatch(each) for each in matchers.split(",")]
        yield name, {each[1] for each in labels if each is not None}
        assert all(labels), matchers
