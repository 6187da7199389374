"""The garbage collector is off while modules are imported, and only then."""

import gc

import pytest

from syncrelay.collector import resting_collector


def test_nothing_is_collected_and_what_exists_by_the_end_is_passed_over_from_then_on():
    with resting_collector():
        assert not gc.isenabled()
        imported: list[list[object]] = [[]]
    assert gc.isenabled()
    assert not any(each is imported for each in gc.get_objects())


def test_it_works_again_once_the_outermost_has_ended():
    with resting_collector():
        with resting_collector():
            pass
        assert not gc.isenabled()
    assert gc.isenabled()


def test_it_works_again_after_an_import_that_fails():
    with pytest.raises(ImportError), resting_collector():
        raise ImportError
    assert gc.isenabled()
