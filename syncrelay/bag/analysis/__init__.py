"""What a recording tells of its topics, and what a file would make of it: figures, curves, findings, better values."""

from syncrelay.bag.analysis.analysis import Analysis, GroupAnalysis, analyze, proposed_text, settled
from syncrelay.bag.analysis.changes import Change, file_with_changes, patch
from syncrelay.bag.analysis.inventory import Topic, inventory, inventory_of
from syncrelay.bag.analysis.proposal import Proposal, propose, propose_for

__all__ = [
    "Analysis",
    "Change",
    "GroupAnalysis",
    "Proposal",
    "Topic",
    "analyze",
    "file_with_changes",
    "inventory",
    "inventory_of",
    "patch",
    "propose",
    "propose_for",
    "proposed_text",
    "settled",
]
