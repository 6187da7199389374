"""The state as Prometheus metrics: Prometheus's own parser reads them, and counters add up."""

import re
from dataclasses import replace
from pathlib import Path

import pytest
from prometheus_client.openmetrics import parser as open_metrics
from prometheus_client.parser import text_string_to_metric_families

from syncrelay.explain import Code, Finding, Sender, Severity
from syncrelay.status import Phase
from syncrelay.status.metrics import exposition
from tests.status.support.states import BEGAN, S, relay, started, working

_SILENT = Finding(Code.SILENT, Severity.WARN, "/camera has been silent for 7 s", None, 0)


def samples(state):
    """The values of a scrape by name and labels."""
    return _values(text_string_to_metric_families(exposition(state)[0].decode()))


def _values(families):
    return {(each.name, frozenset(each.labels.items())): each.value for family in families for each in family.samples}


def value(found, name, **labels):
    return found[name, frozenset(labels.items())]


@pytest.mark.parametrize("state", [relay(), relay(started()), relay(working(), started())])
def test_every_state_can_be_parsed(state):
    assert samples(state)


def test_both_formats_give_the_same_series():
    text, _ = exposition(relay(working()), "application/openmetrics-text; version=1.0.0,text/plain;q=0.5")
    families = open_metrics.text_string_to_metric_families(text.decode())
    assert _values(families) == samples(relay(working()))


def test_received_is_matched_and_dropped_and_waiting():
    found = samples(relay(working()))
    of_camera = {"group": "front", "topic": "/camera"}
    outcomes = [
        count
        for (name, labels), count in found.items()
        if name == "syncrelay_messages_total" and of_camera.items() <= dict(labels).items()
    ]
    waiting = value(found, "syncrelay_queue_length", **of_camera)
    assert sum(outcomes) + waiting == value(found, "syncrelay_messages_received_total", **of_camera) == 34
    assert value(found, "syncrelay_messages_total", **of_camera, outcome="late") == 1
    assert value(found, "syncrelay_messages_total", **of_camera, outcome="matched") == 30


def test_what_each_node_sent_and_what_came_of_it_is_counted():
    report = working()
    camera, lidar = report.facts.inputs
    senders = Sender("/usb_cam", 9, 8, sent_in_all=700, delivered_in_all=650), Sender("/gone", 0, 0, sent_in_all=3)
    camera = replace(camera, graph=replace(camera.graph, senders=senders))
    found = samples(relay(replace(report, facts=replace(report.facts, inputs=(camera, lidar)))))
    of_camera = {"group": "front", "topic": "/camera"}
    for node, sent, delivered in (("/usb_cam", 700, 650), ("/gone", 3, 0)):
        assert value(found, "syncrelay_messages_sent_total", **of_camera, publisher=node) == sent
        assert value(found, "syncrelay_messages_delivered_total", **of_camera, publisher=node) == delivered


def test_the_time_of_the_last_set_is_told_once_there_was_one():
    name = "syncrelay_last_set_timestamp_seconds"
    assert value(samples(relay(working())), name, group="front") == pytest.approx((BEGAN + 3 * S) / S)
    assert not [each for each, _ in samples(relay(started())) if each == name]


def test_histograms_are_in_seconds_and_count_every_set():
    found = samples(relay(working()))
    for quantity, seconds in (("span", 0.005), ("latency", 0.002)):
        name = f"syncrelay_set_{quantity}_seconds"
        assert value(found, f"{name}_count", group="front") == value(found, "syncrelay_sets_total", group="front") == 30
        assert value(found, f"{name}_sum", group="front") == pytest.approx(30 * seconds)
        assert value(found, f"{name}_bucket", group="front", le=f"{seconds:g}") == 30
        assert value(found, f"{name}_bucket", group="front", le="0.001") == 0


def test_readiness_reloads_and_build_are_told():
    found = samples(relay(working(), reloads=4))
    assert value(found, "syncrelay_ready") == 1
    assert value(found, "syncrelay_reloads_total") == 4
    assert value(samples(relay(working(), phase=Phase.DRAINING)), "syncrelay_ready") == 0
    build = next(dict(labels) for name, labels in found if name == "syncrelay_build_info")
    assert set(build) == {"version", "python", "receives_by"}


def test_each_finding_is_a_series_while_it_holds():
    found = samples(relay(working()))
    assert value(found, "syncrelay_finding", group="front", code="healthy", severity="ok", topic="") == 1
    found = samples(relay(replace(working(), problems=(_SILENT,))))
    assert value(found, "syncrelay_finding", group="front", code="silent", severity="warn", topic="/camera") == 1


def test_severities_are_named_in_the_reference_as_the_metrics_name_them():
    page = (Path(__file__).parents[2] / "docs" / "reference" / "findings.md").read_text()
    told = set(re.findall(r"`(\w+)`", "\n".join(re.findall("^- Severity: .*$", page, re.MULTILINE))))
    assert told == {severity.name.lower() for severity in Severity}


def test_metrics_are_named_as_prometheus_has_it():
    """What `promtool check metrics` asks for."""
    text = exposition(relay(working()))[0].decode()
    told = {kind: dict(re.findall(rf"^# {kind} (\S+) (.+)$", text, re.MULTILINE)) for kind in ("HELP", "TYPE")}
    assert told["HELP"].keys() == told["TYPE"].keys()
    for name, kind in told["TYPE"].items():
        assert re.fullmatch(r"syncrelay(_[a-z]+)+", name)
        assert told["HELP"][name].endswith(".")
        assert (kind == "counter") == name.endswith("_total")
        assert not name.endswith(("_count", "_sum", "_bucket"))
        # Base units, and none of another scale or abbreviated.
        assert not {"ms", "us", "ns", "milliseconds", "hz", "mb", "kb", "percent"} & set(name.split("_"))
        assert kind in {"counter", "gauge"} or (kind == "histogram" and name.endswith("_seconds"))
    assert len(told["TYPE"]) == len(re.findall(r"^# TYPE", text, re.MULTILINE))
    labels = {label for _, of_sample in samples(relay(working())) for label, _ in of_sample}
    assert labels == {"group", "topic", "outcome", "code", "severity", "le", "version", "python", "receives_by"}


def test_a_finding_that_is_made_twice_is_one_series():
    twice = working()
    twice = replace(twice, problems=(_SILENT, _SILENT))
    text = exposition(relay(twice))[0].decode()
    assert len(re.findall(r'^syncrelay_finding\{.*code="silent"', text, re.MULTILINE)) == 1


def test_names_come_as_they_are_whatever_they_hold():
    camera, lidar = working().facts.inputs
    odd = 'a"b\\n\\\n{},='
    camera = replace(camera, graph=replace(camera.graph, senders=(Sender(odd, 1, 1, sent_in_all=1),)))
    found = samples(relay(replace(working(), facts=replace(working().facts, inputs=(camera, lidar)))))
    assert value(found, "syncrelay_messages_sent_total", group="front", topic="/camera", publisher=odd) == 1
