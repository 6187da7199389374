"""configs/grafana.json: Grafana can import it, and it queries only what /metrics has."""

import json
import re
from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import Any, Final

import pytest
from prometheus_client.parser import text_string_to_metric_families

from syncrelay.explain import Sender
from syncrelay.status.metrics import exposition
from tests.status.support.states import relay, working

_DASHBOARD: Final[dict[str, Any]] = json.loads((Path(__file__).parents[2] / "configs" / "grafana.json").read_text())
_TARGETS: Final = [(panel, target) for panel in _DASHBOARD["panels"] for target in panel["targets"]]
_EXPRESSIONS: Final = [
    *(target["expr"] for _, target in _TARGETS),
    *(each["expr"] for each in _DASHBOARD["annotations"]["list"]),
]
_MATCHERS: Final = re.compile(r"(\w+)\{([^}]*)\}")
_MATCHER = re.compile(r"(\w+)(?:=|!=|=~|!~)\"[^\"]*\"")
_PANELS = _DASHBOARD["panels"]
_VARIABLES = {each["name"]: each for each in _DASHBOARD["templating"]["list"]}
_DATASOURCE = {"type": "prometheus", "uid": "${datasource}"}
# Labels that Prometheus adds to each series, and variables that Grafana defines.
_OF_A_SCRAPE = {"job", "instance"}
_BUILT_IN = {"__rate_interval", "__interval"}
_FUNCTIONS = {"changes", "count", "histogram_quantile", "max", "rate", "sum", "time", "vector"}
_SENDERS = (Sender("/usb_cam", 9, 8, sent_in_all=700, delivered_in_all=650),)
_GROUPING = re.compile(r"\b(?:by|without|on|ignoring) ?\(([^)]*)\)")


def _series(expression: str) -> Iterator[tuple[str, set[str]]]:
    """The name of each series in a query, with the labels that select it."""
    for name, matchers in _MATCHERS.findall(expression):
        labels = [_MATCHER.fullmatch(each) for each in matchers.split(",")]
        yield name, {each[1] for each in labels if each is not None}
        assert all(labels), matchers


def _exported():
    """The labels of each series of a scrape, by the name of the series."""
    report = working()
    inputs = tuple(replace(each, graph=replace(each.graph, senders=_SENDERS)) for each in report.facts.inputs)
    with_senders = replace(report, facts=replace(report.facts, inputs=inputs))
    text = exposition(relay(with_senders))[0].decode()
    samples = [sample for family in text_string_to_metric_families(text) for sample in family.samples]
    return {each.name: set(each.labels) | _OF_A_SCRAPE for each in samples}


_EXPORTED = _exported()


def _left(expression):
    """The labels of the result of a query."""
    grouped = [set(re.split(r", ?", labels)) for labels in _GROUPING.findall(expression)]
    return grouped[0] if grouped else set.intersection(*(_EXPORTED[name] for name, _ in _series(expression)))


@pytest.mark.parametrize("expression", _EXPRESSIONS)
def test_a_query_asks_for_series_and_labels_that_there_are(expression):
    asked = list(_series(expression))
    assert asked
    for name, labels in asked:
        assert labels <= _EXPORTED[name]
        assert labels >= _OF_A_SCRAPE
    for labels in _GROUPING.findall(expression):
        assert set(re.split(r", ?", labels)) <= set.union(*(_EXPORTED[name] for name, _ in asked))


@pytest.mark.parametrize("expression", _EXPRESSIONS)
def test_a_query_has_no_word_that_is_not_known(expression):
    rest = _GROUPING.sub(" ", _MATCHERS.sub(" ", expression))
    assert rest.count("(") == rest.count(")")
    called = set(re.findall(r"(\w+) ?\(", rest))
    assert called - {"or"} <= _FUNCTIONS
    words = set(re.findall(r"[a-z_]\w*", re.sub(r"\[\$\w+\]", "", rest)))
    assert words <= _FUNCTIONS | {"or"}
    ranges = re.findall(r"\[([^\]]*)\]", rest)
    assert set(ranges) <= {"$__rate_interval", "$__interval"}
    counters = re.findall(r"(?:rate|changes)\((\w+)", expression)
    assert all(name.endswith(("_total", "_bucket")) for name in counters)


def test_every_variable_that_is_used_is_declared_and_every_one_is_used():
    told = json.dumps([_PANELS, _DASHBOARD["annotations"], _DASHBOARD["templating"]])
    used = {first or second for first, second in re.findall(r"\$(?:\{(\w+)\}|(\w+))", told)}
    assert used - _BUILT_IN - {"__all"} == set(_VARIABLES)


def test_choices_are_labels_that_there_are():
    for name in ("job", "instance", "group"):
        asked = re.fullmatch(r"label_values\((\w+)(?:\{(.*)\})?, (\w+)\)", _VARIABLES[name]["query"]["query"])
        assert asked
        assert asked[3] == name
        assert {name} <= _EXPORTED[asked[1]]
        for metric, labels in _series(asked[0]):
            assert labels <= _EXPORTED[metric]


def test_legends_name_labels_that_a_result_has():
    for _, target in _TARGETS:
        assert set(re.findall(r"\{\{(\w+)\}\}", target["legendFormat"])) <= _left(target["expr"])


def test_panels_are_in_order_and_do_not_overlap():
    assert {panel["type"] for panel in _PANELS} <= {"stat", "table", "timeseries"}
    assert sorted(panel["id"] for panel in _PANELS) == list(range(1, len(_PANELS) + 1))
    for panel in _PANELS:
        assert panel["title"]
        assert panel["description"]
        assert panel["datasource"] == _DATASOURCE
        assert panel["fieldConfig"]["defaults"].get("unit", "short") in {"hertz", "percentunit", "s", "short"}
        place = panel["gridPos"]
        assert place["w"] > 0
        assert place["h"] > 0
        assert place["x"] + place["w"] <= 24
        references = [target["refId"] for target in panel["targets"]]
        assert len(set(references)) == len(references)
        assert all(target["datasource"] == _DATASOURCE for target in panel["targets"])
    for one, other in combinations([panel["gridPos"] for panel in _PANELS], 2):
        apart = [one[at] + one[size] <= other[at] or other[at] + other[size] <= one[at] for at, size in ("xw", "yh")]
        assert any(apart)


def test_it_is_a_dashboard_of_its_own_that_changes_none():
    assert "id" not in _DASHBOARD
    assert (_DASHBOARD["title"], _DASHBOARD["uid"]) == ("syncrelay", "syncrelay")
    assert _DASHBOARD["schemaVersion"] >= 36
    assert _VARIABLES["datasource"]["type"] == "datasource"


def test_every_metric_is_on_it_or_is_read_off_another():
    shown = {name for expression in _EXPRESSIONS for name, _ in _series(expression)}
    others = {f"syncrelay_set_{what}_seconds_{part}" for what in ("span", "latency") for part in ("count", "sum")}
    assert set(_EXPORTED) == shown | others
