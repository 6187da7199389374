"""The commands that read recordings, run here: hundreds of times in the time that a process takes to start."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from syncrelay.cli.analyze import Asked, analyze_bag
from syncrelay.cli.boundary import AT_FAULT, DONE
from syncrelay.cli.init import init_from_bag
from syncrelay.cli.replay import Wanted, replay
from syncrelay.cli.test import test as run_tests
from syncrelay.errors import SyncRelayError
from syncrelay.rig.what_if import parse_fault

_WORDS = ("late: /camera 60s", "drop: /lidar 40%", "offset: /camera 290min", "drift: /lidar -99999ppm", "dead: /lidar")
_FAULTS = tuple(map(parse_fault, (*_WORDS[:4], f"{_WORDS[4]} from 12s")))


def _test_file(bag: str, file: str, folder: Path) -> str:
    """Write tests of a recording, as it is and with faults, that expect all there is to expect; the file's path."""
    expect = {
        "sets": 1,
        "match_rate": 0.5,
        "span_p95": "< 1ms",
        "span_max": "1ms",
        "latency_p95": "1ms",
        "latency_max": "> 9min",
        "findings": ["alone"],
        "inputs": {"camera": {"received": 3, "drops": {"late": 2}}},
    }
    cases = {
        name: {"recording": bag, "what_if": faults, "expect": expect} for name, faults in (("it", ()), ("if", _WORDS))
    }
    path = folder / "tests.yaml"
    path.write_text(json.dumps({"version": 1, "config": file, "cases": cases}))
    return str(path)


def _readers(bag: str, file: str, folder: Path) -> dict[str, Callable[[], int]]:
    """What reads a recording, by how it is called; what is written goes into the folder."""
    of_file = Asked(config=file, text=Path(file).read_text(), topics=(), write=None, html=None, json=False, indent=None)
    by_topics = replace(of_file, config=None, text=None, topics=("/camera", "/lidar"))
    with_html = replace(of_file, html=str(folder / "report.html"))
    as_json = replace(of_file, json=True)
    return {
        "replay": lambda: replay([bag], [file], Wanted(sets=True, drops=True, output=None)),
        "replay --what-if": lambda: replay([bag], [file], Wanted(sets=True, drops=True, output=None, what_if=_FAULTS)),
        "test": lambda: run_tests([_test_file(bag, file, folder)], "junit", update=True),
        "replay -o": lambda: replay([bag], [file], Wanted(sets=False, drops=False, output=str(folder / "out.mcap"))),
        "analyze": lambda: analyze_bag(bag, with_html),
        "analyze, JSON": lambda: analyze_bag(bag, as_json),
        "analyze, topics": lambda: analyze_bag(bag, by_topics),
        "init": lambda: init_from_bag(bag, None),
    }


def read_by_all(bag: Path, file: Path, folder: Path, about: str) -> None:
    """Run all of them; what flies out of one, but an error in words, tells it, and `about` the recording."""
    for command, run in _readers(str(bag), str(file), folder).items():
        (folder / "out.mcap").unlink(missing_ok=True)
        try:
            assert run() in (DONE, AT_FAULT)
        except SyncRelayError as error:
            assert str(error), command  # noqa: PT017  any error of ours will do
        except Exception as error:
            error.add_note(f"{command} of a recording with {about}")
            raise
