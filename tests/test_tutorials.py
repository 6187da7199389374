"""The tutorial on a recording, done as it says: its files written, its commands run in order, their output seen."""

import re
from pathlib import Path

import pytest

from tests.cli.command import run_here

_PAGE = (Path(__file__).parents[1] / "docs/tutorial/recording.md").read_text()
_STEPS = re.findall(r"(?:Write `([\w.]+)`:\n\n)?^```(\w+)\n(.*?)^```", _PAGE, re.DOTALL | re.MULTILINE)


def test_the_tutorial_on_a_recording_does_what_it_says(tmp_path, monkeypatch):
    pytest.importorskip("pyarrow")
    monkeypatch.chdir(tmp_path)
    said = ""
    shown = 0
    for name, kind, text in _STEPS:
        if kind == "yaml":
            (tmp_path / name).write_text(text)
        elif kind == "console":
            said = "".join(map(_output_of, text.splitlines()))
        else:
            missing = [line for line in text.splitlines() if line not in said]
            assert missing == [], said
            shown += 1
    assert shown > 5
    assert (tmp_path / "report.html").stat().st_size > 10_000
    assert "front" in (tmp_path / "proposed.yaml").read_text() or "fused" in (tmp_path / "proposed.yaml").read_text()
    assert list((tmp_path / "dataset").glob("*/front.parquet"))


def _output_of(command: str) -> str:
    ran = run_here(*_words(command.removeprefix("$ syncrelay ")), folder=Path())
    # `diff` exits with 1 where files differ.
    assert ran.returncode == (1 if " diff " in command else 0), ran.stderr
    return ran.stdout + ran.stderr


def _words(line: str) -> list[str]:
    return [quoted or plain for quoted, plain in re.findall(r'"([^"]*)"|(\S+)', line)]
