"""A fleet's report for programs. All times and durations are nanoseconds, shares are of 1."""

from dataclasses import asdict
from typing import Any

from syncrelay.recordings.fleet.figures import RULE, Figures, Ranking, Row
from syncrelay.recordings.fleet.report import FleetReport, Recording
from syncrelay.recordings.fleet.report_findings import Found
from syncrelay.recordings.fleet.suggestions import Suggested


def fleet_as_json(report: FleetReport) -> dict[str, Any]:
    """Return what json.dumps takes. Rows that would be too many to tell apart are null."""
    return {
        "recordings": report.whole.recordings,
        "failed": report.failed,
        "begin": report.begin,
        "last_begin": report.last_begin,
        "worst_first": RULE,
        "whole": _figures(report.whole),
        "robots_by": report.robots_by,
        "by_robot": _ranking(report.by_robot, "robot"),
        "by_day": _ranking(report.by_day, "day"),
        "by_group": _ranking(report.by_group, "group"),
        "by_topic": None if not report.by_topic.is_told else [_topic(row) for row in report.by_topic.rows],
        "findings": [_found(each) for each in report.findings],
        "are_findings_told": report.are_findings_told,
        "worst_recordings": [_recording(each) for each in report.recordings],
        "failures": [asdict(each) for each in report.failures],
    }


def _ranking(ranking: Ranking, key: str) -> list[dict[str, Any]] | None:
    if not ranking.is_told:
        return None
    return [{key: row.name, **_figures(row.figures)} for row in ranking.rows]


def _figures(figures: Figures) -> dict[str, Any]:
    return {
        **asdict(figures),
        **{key: dict(getattr(figures, key)) for key in ("dropped", "faults", "codes")},
        "values": [_suggested(each) for each in figures.values],
    }


def _topic(row: Row) -> dict[str, Any]:
    figures = _figures(row.figures)
    told = {"distance": figures.pop("span"), "delay": figures.pop("latency")}
    # Sets are a group's.
    for key in ("sets", "now", "possible"):
        del figures[key]
    return {"topic": row.name, **figures, **told}


def _found(found: Found) -> dict[str, Any]:
    return {
        "code": found.code,
        "severity": found.severity,
        "group": found.where.group,
        "topic": found.where.topic or None,
        "recordings": found.recordings,
        "seconds": found.seconds,
        "longest": {"recording": found.example, "text": found.text, "suggestion": found.advice or None},
        "values": [_suggested(each) for each in found.values],
        "gain": asdict(found.gain),
    }


def _suggested(suggested: Suggested) -> dict[str, Any]:
    value, where = suggested.value, suggested.value.where
    at = {"group": where.group, "topic": where.topic or None, "key": value.key, "value": value.value}
    return {**at, **asdict(suggested.gain)}


def _recording(each: Recording) -> dict[str, Any]:
    told = asdict(each)
    del told["rank"]
    return told
