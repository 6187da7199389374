"""configs/foxglove.json: a layout as Foxglove imports it, of topics that the relay publishes."""

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from syncrelay.config.names_in_graph import SCALARS

_LAYOUT = json.loads((Path(__file__).parents[1] / "configs" / "foxglove.json").read_text())
_PANELS: dict[str, dict[str, Any]] = _LAYOUT["configById"]
# Of each type of panel, the keys that must be there.
_REQUIRED = {
    "DiagnosticSummary": {"topicToRender", "minLevel", "pinnedIds", "hardwareIdFilter"},
    "DiagnosticStatusPanel": {"topicToRender", "selectedHardwareId", "selectedName"},
    "StateTransitions": {"paths"},
    "Plot": {"paths", "xAxisVal"},
}
_PATH = re.compile(r"(?P<topic>(?:/\w+)+)\.(?P<fields>[\w.:\[\]]+(?:\{\w+==\"[^\"]+\"\})?[\w.]*)")


def _paths(panel: dict[str, Any]) -> list[tuple[str, str]]:
    """Topic and fields of each path that a panel draws."""
    found = [_PATH.fullmatch(each["value"]) for each in panel.get("paths", ())]
    return [(each["topic"], each["fields"]) for each in found if each is not None]


def _leaves(node: Any) -> Iterator[str]:
    """The panels of a layout, which is a binary tree."""
    if isinstance(node, str):
        yield node
        return
    assert node.keys() <= {"direction", "first", "second", "splitPercentage"}
    assert node["direction"] in {"row", "column"}
    assert 0 < node.get("splitPercentage", 50) < 100
    yield from _leaves(node["first"])
    yield from _leaves(node["second"])


def test_it_is_a_layout_that_shows_each_panel_once():
    assert _LAYOUT.keys() == {"configById", "globalVariables", "userNodes", "playbackConfig", "layout"}
    assert sorted(_leaves(_LAYOUT["layout"])) == sorted(_PANELS)
    for name, panel in _PANELS.items():
        kind, bang, _ = name.partition("!")
        assert bang
        assert _REQUIRED[kind] <= panel.keys()
        assert len(_paths(panel)) == len(panel.get("paths", ()))


def test_numbers_are_the_data_of_a_float():
    fields = [field for name, panel in _PANELS.items() if name.startswith("Plot!") for _, field in _paths(panel)]
    assert fields
    assert set(fields) == {"data"}


def test_diagnostics_are_those_of_the_group_whose_numbers_are_drawn():
    topics = [topic for name, panel in _PANELS.items() if name.startswith("Plot!") for topic, _ in _paths(panel)]
    (node, group), *others = dict.fromkeys(tuple(topic.split("/")[1:3]) for topic in topics)
    assert others == []
    assert topics == [f"/{node}/{group}/{figure}" for figure in SCALARS]
    of_diagnostics = [panel for panel in _PANELS.values() if "topicToRender" in panel]
    assert {panel["topicToRender"] for panel in of_diagnostics} == {"/diagnostics"}
    (detailed,) = (panel for panel in _PANELS.values() if "selectedName" in panel)
    assert (detailed["selectedHardwareId"], detailed["selectedName"]) == (f"/{node}", f"{node}: {group}")
    (states,) = (panel for name, panel in _PANELS.items() if name.startswith("StateTransitions!"))
    assert _paths(states) == [("/diagnostics", f'status[:]{{name=="{node}: {group}"}}.level')]
