"""The examples and the programs on the page of the library run."""

import re
import runpy
import sys
from pathlib import Path

import pytest

import syncrelay.sync
from tests.recordings.bag.making import write_mcap
from tests.ros.cdr_messages import VECTOR, vector
from tests.ros.configs import config, inputs
from tests.ros.frames import Frame

_ROOT = Path(__file__).parents[1]
_EXAMPLES = _ROOT / "examples"
_LIBRARY = (_ROOT / "docs/reference/library.md").read_text()
_SHOWN = re.findall(r"^```python\n(.*?)^```\n\n```text\n(.*?)^```", _LIBRARY, re.DOTALL | re.MULTILINE)


@pytest.mark.parametrize(("program", "printed"), _SHOWN)
def test_what_the_page_of_the_library_shows_is_what_comes(program, printed, tmp_path, capsys):
    script = tmp_path / "shown.py"
    script.write_text(program)
    runpy.run_path(str(script))
    assert capsys.readouterr().out == printed


def test_the_page_of_the_library_shows_something():
    assert _SHOWN


def test_every_public_name_of_the_engine_is_on_the_page_of_the_library():
    assert [name for name in syncrelay.sync.__all__ if f"`{name}" not in _LIBRARY] == []


def test_every_example_is_named_with_what_it_shows():
    page = (_EXAMPLES / "README.md").read_text()
    assert [each.name for each in _EXAMPLES.glob("*.py") if f"({each.name})" not in page] == []


def test_rows_of_csv_files_are_matched_and_each_is_accounted_for(tmp_path, monkeypatch, capsys):
    (tmp_path / "left.csv").write_text("10.00,a\n10.10,b\n10.20,c\n")
    (tmp_path / "right.csv").write_text("10.012,x\n10.15,y\n10.201,z\n10.3,q\n")
    words = ["match_csv.py", "0.02", str(tmp_path / "left.csv"), str(tmp_path / "right.csv")]
    monkeypatch.setattr(sys, "argv", words)
    runpy.run_path(str(_EXAMPLES / words[0]), run_name="__main__")
    printed, told = capsys.readouterr()
    assert printed.split() == ["10.00,a,10.012,x", "10.20,c,10.201,z"]
    left, right = told.splitlines()
    assert left.endswith("left.csv: 3 rows, 2 matched; 1 no partner near enough")
    assert "right.csv: 4 rows, 2 matched; " in right


def test_sets_of_a_recording_are_read_as_tables(tmp_path, monkeypatch, capsys):
    pytest.importorskip("pyarrow")
    begin, step = 10**18, 10**8
    frames = [
        Frame(topic, VECTOR, stamp, vector(stamp))
        for number in range(20)
        for topic, stamp in (("/left", begin + number * step), ("/right", begin + number * step + 4_000_000))
    ]
    recording = write_mcap(tmp_path / "drive.mcap", frames)
    group = {"policy": "approximate_time", "slop": "20ms", "topics": inputs({"/left": VECTOR, "/right": VECTOR})}
    (tmp_path / "fusion.yaml").write_text(config({"fused": group}))
    monkeypatch.setattr(sys, "argv", ["read_recording.py", str(tmp_path / "fusion.yaml"), str(recording)])
    runpy.run_path(str(_EXAMPLES / "read_recording.py"), run_name="__main__")
    assert "sets of /left, /right: 4.00 ms apart on average" in capsys.readouterr().out
