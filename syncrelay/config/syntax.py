"""PyYAML's jargon in words."""

import yaml

from syncrelay.config.problems import Span


def in_words(error: yaml.MarkedYAMLError, lines: tuple[str, ...]) -> tuple[str, Span]:
    """Return what is wrong with the file's form, and where."""
    mark = error.problem_mark or error.context_mark
    span = Span(mark.line + 1, mark.column + 1, 1) if mark else Span(1, 1, 1)
    return str(error.problem or error.context), span
