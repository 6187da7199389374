"""A command on many recordings: its progress, its end, its exit code."""

from argparse import Namespace
from collections.abc import Sequence

from syncrelay.fleet.task import Task


def do_on_many(task: Task, words: Sequence[str], arguments: Namespace) -> int:
    """Do a task on all recordings that words name, into a folder, as the options of add_fleet_options say.

    Returns the exit code. Raises SyncRelayError where a word names no recording, or the folder cannot be used.
    """
    raise NotImplementedError
