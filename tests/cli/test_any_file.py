"""Every command that takes a file does so with any file that is in order, and the commands agree with each other.

The files are those of configs/, of tests/config/valid and of the pages, and files drawn from the models. Each goes with
a recording that fits it, and with one that holds nothing.
"""

import itertools
import json
import os
import re
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest
import yaml

from syncrelay.config import Config, load_text
from syncrelay.recordings.analysis.live import LiveStreams, analyze_live
from syncrelay.recordings.analysis.report_text import suggestion_lines
from tests.cli.command import ROOT, run_here
from tests.drawn_files import drawn_files, frames_for
from tests.faults.extent import chosen
from tests.recordings.bag.making import write_mcap
from tests.ros.frames import Frame

_PARTS, _FILES_A_PART = chosen(short=(2, 3), long=(240, 25))
_SEED = chosen(short="any file", long=os.urandom(4).hex())
_BLOCK = re.compile(r"^```yaml\n(version:.*?)^```", re.DOTALL | re.MULTILINE)
_PAGES = [ROOT / "README.md", *(ROOT / "docs").glob("*/*.md")]
_SHIPPED = {
    path.name: path.read_text() for at in ("configs", "tests/config/valid") for path in (ROOT / at).glob("*.yaml")
}
_SHIPPED |= {
    f"{page.stem} {number}": text
    for page in _PAGES
    for number, text in enumerate(_BLOCK.findall(page.read_text()))
    if "\ncases:" not in text
}


@pytest.mark.faults
# The short form has some from short to long.
@pytest.mark.parametrize("name", sorted(_SHIPPED, key=lambda name: len(_SHIPPED[name]))[:: chosen(short=10, long=1)])
def test_every_command_takes_every_file_that_is_shipped(name, tmp_path):
    _try(_SHIPPED[name], tmp_path, f"{_SEED} {name}")


@pytest.mark.faults
@pytest.mark.parametrize("part", range(_PARTS))
def test_every_command_takes_every_file_that_is_drawn(part, tmp_path):
    for number, text in enumerate(itertools.islice(drawn_files(f"{_SEED} {part}"), _FILES_A_PART)):
        folder = tmp_path / str(number)
        folder.mkdir()
        _try(text, folder, f"{_SEED} {part} {number}")


def _try(text: str, folder: Path, seed: str) -> None:
    (folder / "fusion.yaml").write_text(text)
    config = load_text(text)
    frames = frames_for(config, seed)
    write_mcap(folder / "rig.mcap", frames)
    write_mcap(folder / "empty.mcap", [])
    where = f"seed {seed}\n{text}"
    _run("validate", "fusion.yaml", folder=folder, where=where, codes=(0,))
    _run("graph", "fusion.yaml", folder=folder, where=where, codes=(0,))
    # Types may come from the graph.
    _run("interfaces", "fusion.yaml", "-o", "messages", folder=folder, where=where, codes=(0, 2))
    _run("diff", "fusion.yaml", "fusion.yaml", folder=folder, where=where, codes=(0,))
    for bag in ("rig.mcap", "empty.mcap"):
        of = ("--config", "fusion.yaml", bag)
        replayed = _run("replay", *of, "--json", "--drops", "-o", f"out_{bag}", folder=folder, where=where)
        analyzed = _run("analyze", *of, "--json", "--html", f"{bag}.html", folder=folder, where=where)
        _run("analyze", *of, "--write", f"better_{bag}.yaml", folder=folder, where=where)
        if (folder / f"better_{bag}.yaml").exists():
            _run("validate", f"better_{bag}.yaml", folder=folder, where=where, codes=(0,))
        exported = _run("export", *of, "-o", f"dataset_{bag}", "--jobs", "1", folder=folder, where=where)
        assert (replayed.returncode, exported.returncode) in {(0, 0), (1, 1)}, where
        if replayed.returncode == 0:
            _agree(replayed.stdout, analyzed.stdout, where)
            _expect(analyzed.stdout, bag, folder, where)
    _observe(config, frames)


def _run(*words: str, folder: Path, where: str, codes: tuple[int, ...] = (0, 1)) -> Any:
    ran = run_here(*words, folder=folder)
    told = f"{words}: {ran.returncode}\n{ran.stderr}\n{where}"
    assert ran.returncode in codes, told
    assert "Traceback" not in ran.stderr, told
    return ran


def _expect(analyzed: str, bag: str, folder: Path, where: str) -> None:
    """Assert that `test` finds in a recording what `analyze` counts there."""
    cases = {
        group["name"]: {
            "group": group["name"],
            "recording": bag,
            "expect": {"sets": group["sets"], "received": sum(each["received"] for each in group["inputs"])},
        }
        for group in json.loads(analyzed)["groups"]
    }
    (folder / "test.yaml").write_text(yaml.safe_dump({"version": 1, "config": "fusion.yaml", "cases": cases}))
    _run("test", "test.yaml", folder=folder, where=where, codes=(0,))


def _observe(config: Config, frames: list[Frame]) -> None:
    """Have what `observe` saw live analyzed as it does, in place of a minute on DDS."""
    live = LiveStreams(config.groups)
    for group in config.groups:
        came = [[(each.time, each.time) for each in frames if each.topic == topic.topic] for topic in group.topics]
        live.take(group.name, came)
    for analysis in analyze_live(config, config.groups, live):
        assert json.dumps(asdict(analysis.suggestion))
        assert all(suggestion_lines(analysis))


def _agree(replayed: str, analyzed: str, where: str) -> None:
    """Assert that analyze counts the sets that replay gives, and that each message is in a set or dropped."""
    sets = [json.loads(line) for line in replayed.splitlines()]
    for group in json.loads(analyzed)["groups"]:
        own = [each for each in sets if each["group"] == group["name"] and "stamps" in each]
        assert len(own) == group["sets"], where
        for each in group["inputs"]:
            # With latest_time a message may be in many sets.
            if group["policy"] != "latest_time":
                assert each["received"] == each["matched"] + sum(each["dropped"].values()), (each, where)
        suggestion = group["suggestion"]
        assert 0 <= suggestion["now"] <= suggestion["possible"] or not suggestion["possible"], (suggestion, where)
