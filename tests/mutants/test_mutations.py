"""Mutants say what they should of code, and leave alone what is for people and tools."""

import ast

from tests.mutants.mutations import mutants_of, mutated

_SOURCE = '''"""A module."""
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import x < y if False else 1


def most(limit: "int | None", values: "list[int]") -> "int | bool | None":
    """The first above a limit."""
    for value in values:
        if limit is None or value + 1 > limit and not value:
            return value
        log.info("seen %d", value + 1)
        if value > 1_000_000:
            return False
        continue
    count(values)
    return None
'''.replace("    import x < y if False else 1\n", "    import x\n")


def test_each_mutant_is_a_module_with_one_thing_changed():
    found = mutants_of(_SOURCE)
    changes = {(each.before, each.after) for each in found}
    assert ("limit is None", "(limit is not None)") in changes
    assert ("value + 1", "(value - 1)") in changes
    assert ("value + 1 > limit", "(value + 1 >= limit)") in changes
    assert ("not value", "(value)") in changes
    assert ("return value", "return None") in changes
    assert ("continue", "break") in changes
    assert ("count(values)", "pass") in changes
    assert {after for before, after in changes if before in ("1_000_000", "return False")} == {"(2000000)"}
    for each in found:
        ast.parse(mutated(_SOURCE, each))
    assert len({mutated(_SOURCE, each) for each in found}) == len(found)


def test_what_is_for_people_and_tools_stays_as_it_is():
    lines = {each.line for each in mutants_of(_SOURCE)}
    assert lines == {11, 12, 14, 15, 16, 17}
