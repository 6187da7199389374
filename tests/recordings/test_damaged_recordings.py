"""Whatever a recording holds, each command that reads it gives what there is and says the rest: it ends with 0 or 1."""

from pathlib import Path

import pytest

from tests.faults.extent import chosen
from tests.recordings.bag.damage import KINDS, damaged, with_lying_lengths
from tests.recordings.in_process import read_by_all
from tests.ros.cdr_messages import VECTOR
from tests.ros.configs import config, inputs

pytestmark = pytest.mark.faults

_PLACES = chosen(short=2, long=100)


@pytest.mark.timeout(chosen(short=600, long=3600))
@pytest.mark.parametrize("kind", KINDS)
def test_each_command_ends_in_words_whatever_is_damaged(kind: str, tmp_path: Path, capsys):
    topics = inputs({"/camera": VECTOR, "/lidar": VECTOR})
    group = {"policy": "approximate_time", "slop": "5ms", "restamp": "earliest", "max_wait": "1s", "topics": topics}
    file = tmp_path / "f.yaml"
    file.write_text(config({"front": group}))
    path = KINDS[kind](tmp_path)
    whole = path.read_bytes()
    for made in (damaged, with_lying_lengths):
        for what, content in made(whole, places=_PLACES, seed=41):
            path.write_bytes(content)
            read_by_all(path, file, tmp_path, what)
            capsys.readouterr()
