"""The commands that read recordings, run here: hundreds of times in the time that a process takes to start."""

import json
from pathlib import Path

from syncrelay.cli.boundary import AT_FAULT, DONE
from syncrelay.cli.dispatch import dispatch
from syncrelay.cli.stop import StopRequest
from syncrelay.errors import SyncRelayError

_FAULTS = ("late: /camera 60s", "drop: /lidar 40%", "offset: /camera 290min", "drift: /lidar -99999ppm", "dead: /lidar")


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
        name: {"recording": bag, "what_if": faults, "expect": expect} for name, faults in (("it", ()), ("if", _FAULTS))
    }
    path = folder / "tests.yaml"
    path.write_text(json.dumps({"version": 1, "config": file, "cases": cases}))
    return str(path)


def _commands(bag: str, file: str, folder: Path) -> dict[str, tuple[str, ...]]:
    """What reads a recording, by a name for it; what is written goes into the folder."""
    given = (bag, "--config", file)
    faults = [word for fault in (*_FAULTS[:4], f"{_FAULTS[4]} from 12s") for word in ("--what-if", fault)]
    return {
        "replay": ("replay", *given, "--json", "--drops"),
        "replay --what-if": ("replay", *given, "--json", "--drops", *faults),
        "test": ("test", _test_file(bag, file, folder), "--format", "junit"),
        "replay -o": ("replay", *given, "-o", str(folder / "out.mcap")),
        "analyze": ("analyze", *given, "--html", str(folder / "report.html")),
        "analyze, JSON": ("analyze", *given, "--json"),
        "analyze, topics": ("analyze", bag, "/camera", "/lidar"),
        "init": ("init", "--from-bag", bag),
    }


def read_by_all(bag: Path, file: Path, folder: Path, about: str) -> None:
    """Run all of them; what flies out of one, but an error in words, tells it, and `about` the recording."""
    for name, words in _commands(str(bag), str(file), folder).items():
        (folder / "out.mcap").unlink(missing_ok=True)
        try:
            assert dispatch(words, stop=StopRequest()) in (DONE, AT_FAULT)
        except SyncRelayError as error:
            assert str(error), name  # noqa: PT017  any error of ours will do
        except Exception as error:
            error.add_note(f"{name} of a recording with {about}")
            raise
