"""Why nothing comes out, or too little: from what is known of a group to findings in words, with what to do.

Pure: values in, values out. The running relay and the analysis of recordings both ask here.
"""

from syncrelay.clock import UNREADABLE, Step
from syncrelay.config import Tolerance
from syncrelay.config.profile import Mismatch
from syncrelay.explain.cause_log import CauseLog
from syncrelay.explain.codes import Code, Severity
from syncrelay.explain.distribution import BOUNDS_NS, Distribution, Histogram
from syncrelay.explain.dry_run import EngineDriver
from syncrelay.explain.facts import ClockState, GroupFacts, InputFacts, Pause, Standstill
from syncrelay.explain.figures import GroupFigures, InputFigures
from syncrelay.explain.finding_log import FindingLog, in_words
from syncrelay.explain.findings import Finding
from syncrelay.explain.graph_facts import BundleGraph, Endpoint, GraphSnapshot, InputGraph, Refusal, Sender
from syncrelay.explain.input_observation import Arrivals
from syncrelay.explain.judge import Judge, explanation, judge, with_ok
from syncrelay.explain.lines import GroupLines
from syncrelay.explain.observation import Observation, SentSets
from syncrelay.explain.report import GroupReport, RecentDrop, RecentSet
from syncrelay.explain.rules_graph import RUN_DOCTOR, no_other_node
from syncrelay.explain.standing import NO_SET_MISSED, Share, Standing
from syncrelay.explain.steps import STEP_NS
from syncrelay.explain.tape import Left, Stamps, Tape
from syncrelay.explain.troubles import Trouble, listed, troubles
from syncrelay.explain.try_budget import TryBudget
from syncrelay.explain.unneeded import FOR_WANT_OF_A_PARTNER, DropFates, drop_fates, may_set_pace
from syncrelay.explain.watch import GroupWatch

__all__ = [
    "BOUNDS_NS",
    "FOR_WANT_OF_A_PARTNER",
    "NO_SET_MISSED",
    "RUN_DOCTOR",
    "STEP_NS",
    "UNREADABLE",
    "Arrivals",
    "BundleGraph",
    "CauseLog",
    "ClockState",
    "Code",
    "Distribution",
    "DropFates",
    "Endpoint",
    "EngineDriver",
    "Finding",
    "FindingLog",
    "GraphSnapshot",
    "GroupFacts",
    "GroupFigures",
    "GroupLines",
    "GroupReport",
    "GroupWatch",
    "Histogram",
    "InputFacts",
    "InputFigures",
    "InputGraph",
    "Judge",
    "Left",
    "Mismatch",
    "Observation",
    "Pause",
    "RecentDrop",
    "RecentSet",
    "Refusal",
    "Sender",
    "SentSets",
    "Severity",
    "Share",
    "Stamps",
    "Standing",
    "Standstill",
    "Step",
    "Tape",
    "Tolerance",
    "Trouble",
    "TryBudget",
    "drop_fates",
    "explanation",
    "in_words",
    "judge",
    "listed",
    "may_set_pace",
    "no_other_node",
    "troubles",
    "with_ok",
]
