"""The tests of configs/ pass, each example has a file of them, and they notice every value that is changed."""

import pytest

from syncrelay.recordings.cases import check, load_suite
from tests.recordings.cases.mutants import ALIKE, CONFIGS, survivors

FILES = sorted((CONFIGS / "tests").glob("*.yaml"))


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_the_tests_of_an_example_pass(file):
    results = list(check(load_suite(str(file), environ={})))
    assert results
    assert [(result.case.name, result.mismatches, result.error) for result in results if not result.passed] == []


def test_every_example_has_tests():
    assert [file.name for file in FILES] == sorted(file.name for file in CONFIGS.glob("*.yaml"))


@pytest.mark.long
def test_every_changed_value_is_noticed_that_changes_anything(tmp_path):
    left, tried = survivors(tmp_path)
    assert {(mutant.name, mutant.place) for mutant in left} == ALIKE
    assert tried > 20 * len(ALIKE)
