"""Why nothing comes out, or too little: from what is known of a group to findings in words, with what to do.

Pure: values in, values out. The running relay and the analysis of recordings both ask here.
"""

from syncrelay.config import Tolerance
from syncrelay.explain.distribution import Distribution
from syncrelay.explain.dry_run import Arrival, DryRun, EngineDriver, dry_run
from syncrelay.explain.facts import (
    Endpoint,
    GroupFacts,
    InputFacts,
    InputGraph,
    Mismatch,
    Refusal,
    Standstill,
)
from syncrelay.explain.figures import GroupFigures, InputFigures
from syncrelay.explain.find import explanation, find, problems
from syncrelay.explain.finding_log import FindingLog, in_words
from syncrelay.explain.findings import Code, Finding, Severity
from syncrelay.explain.histogram import BOUNDS_NS, Histogram
from syncrelay.explain.observation import Observation, SentSets
from syncrelay.explain.report import GroupReport, RecentDrop, RecentSet, recent
from syncrelay.explain.watch import GroupWatch

__all__ = [
    "BOUNDS_NS",
    "Arrival",
    "Code",
    "Distribution",
    "DryRun",
    "Endpoint",
    "EngineDriver",
    "Finding",
    "FindingLog",
    "GroupFacts",
    "GroupFigures",
    "GroupReport",
    "GroupWatch",
    "Histogram",
    "InputFacts",
    "InputFigures",
    "InputGraph",
    "Mismatch",
    "Observation",
    "RecentDrop",
    "RecentSet",
    "Refusal",
    "SentSets",
    "Severity",
    "Standstill",
    "Tolerance",
    "dry_run",
    "explanation",
    "find",
    "in_words",
    "problems",
    "recent",
]
