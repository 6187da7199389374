"""A mutant counts as noticed where a test fails or nothing can be imported, and never for how pytest ends otherwise."""

import pytest

from tests.mutants import __main__ as mutants

_MODULE = """
COUNT = 2
TABLE = {4: COUNT}[4]


def same(value):
    return value
"""
# COUNT is in the name of a test alone: with a mutant, pytest does not find it.
_TESTS = """
import pytest
from syncrelay.sync.limits import COUNT, same


@pytest.mark.parametrize("count", [COUNT])
def test_same(count):
    assert same(1) == 1
"""


@pytest.mark.long
def test_what_counts_as_noticed(tmp_path, monkeypatch):
    for name, text in {"syncrelay/sync/limits.py": _MODULE, "tests/sync/test_limits.py": _TESTS}.items():
        path = tmp_path / name
        path.parent.mkdir(parents=True)
        path.write_text(text)
    monkeypatch.setattr(mutants, "ROOT", tmp_path)
    monkeypatch.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")
    monkeypatch.setenv("PYTEST_PLUGINS", "pytest_timeout,pytest_cov.plugin")
    drawn = mutants.drawn("sync", None, 1)
    tried = mutants.tried("sync", drawn, 1, worlds_s=0.0)
    noticed = {(each.line, each.after): is_noticed for (_, each), is_noticed in zip(drawn, tried, strict=True)}
    assert noticed == {(2, "(3)"): False, (3, "(5)"): True, (7, "return None"): True}
