"""What surrounds the reading of a recording."""

import gc
from contextlib import closing

import pytest

from syncrelay.cli.reading import reading
from syncrelay.recordings.bag import open_recording
from tests.recordings.bag.making import rig, write_mcap


def test_the_garbage_collector_looks_less_often_while_a_recording_is_read_however_that_ends(tmp_path):
    usual = gc.get_threshold()
    path = tmp_path / "rig.mcap"
    write_mcap(path, rig(1))
    with closing(open_recording([str(path)])) as recording:
        with reading(recording):
            assert gc.get_threshold()[0] > usual[0]
        with pytest.raises(ZeroDivisionError), reading(recording):
            raise ZeroDivisionError
    assert gc.get_threshold() == usual
