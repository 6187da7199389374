"""Tests of a configuration: drawn, simulated or recorded, and what a file's groups shall make of them."""

from syncrelay.recordings.cases.checking import Mismatch, Result, check
from syncrelay.recordings.cases.load import Suite, load_suite, load_suite_text

__all__ = ["Mismatch", "Result", "Suite", "check", "load_suite", "load_suite_text"]
