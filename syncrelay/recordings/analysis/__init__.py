"""What a recording tells of its topics, and what a file would make of it: figures, curves, findings, better values."""

from syncrelay.recordings.analysis.analysis import Analysis, GroupAnalysis, analyze, find_all, with_suggestions
from syncrelay.recordings.analysis.changes import Change, file_with_changes, patch
from syncrelay.recordings.analysis.inventory import Topic, inventory, inventory_of
from syncrelay.recordings.analysis.proposal import Proposal, propose, propose_for, proposed_text

__all__ = [
    "Analysis",
    "Change",
    "GroupAnalysis",
    "Proposal",
    "Topic",
    "analyze",
    "file_with_changes",
    "find_all",
    "inventory",
    "inventory_of",
    "patch",
    "propose",
    "propose_for",
    "proposed_text",
    "with_suggestions",
]
