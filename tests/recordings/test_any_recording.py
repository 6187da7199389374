"""Whatever a recording holds, each command that reads it gives what there is and says the rest: it ends with 0 or 1.

The commands run here: hundreds of times in the time that a process takes to start.
"""

import json
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from warnings import catch_warnings

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rosbags.rosbag2 import StoragePlugin

from syncrelay.cli.boundary import AT_FAULT, DONE
from syncrelay.cli.dispatch import dispatch
from syncrelay.cli.stop import StopRequest
from syncrelay.config import load_text
from syncrelay.errors import SyncRelayError
from syncrelay.recordings.datasets import read_sets
from tests.faults.extent import chosen
from tests.recordings.bag.damage import KINDS, damaged, with_lying_lengths
from tests.recordings.bag.making import rig_file, write_mcap, write_rosbag2
from tests.ros.cdr_messages import VECTOR, vector
from tests.ros.configs import config, inputs
from tests.ros.frames import Frame
from tests.ros.streams import BEGIN, MS

pytestmark = pytest.mark.faults

_TOPICS = ("/camera", "/lidar")
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


def _read_sets(bag: Path, file: Path) -> int:
    """Read sets as `export` does, without its processes."""
    return DONE if all(batch.num_rows for batch in read_sets(bag, file)) else -1


def _read_by_all(bag: Path, file: Path, folder: Path, about: str) -> None:
    """Run all of them; what flies out of one, but an error in words, tells it, and `about` the recording."""
    runs = {
        name: partial(dispatch, words, stop=StopRequest())
        for name, words in _commands(str(bag), str(file), folder).items()
    }
    runs["read_sets"] = partial(_read_sets, bag, file)
    for name, run in runs.items():
        (folder / "out.mcap").unlink(missing_ok=True)
        try:
            with catch_warnings(action="ignore"):
                assert run() in (DONE, AT_FAULT)
        except SyncRelayError as error:
            assert str(error), name  # noqa: PT017  any error of ours will do
        except Exception as error:
            error.add_note(f"{name} of a recording with {about}")
            raise


_PLACES = chosen(short=1, long=100)


@pytest.mark.timeout(chosen(short=600, long=3600))
@pytest.mark.parametrize("kind", KINDS)
def test_each_command_ends_in_words_whatever_is_damaged(kind: str, tmp_path: Path, capsys):
    file = tmp_path / "f.yaml"
    file.write_text(rig_file(restamp="earliest", max_wait="1s"))
    path = KINDS[kind](tmp_path)
    whole = path.read_bytes()
    for made in (damaged, with_lying_lengths):
        for what, content in made(whole, places=_PLACES, seed=41):
            path.write_bytes(content)
            _read_by_all(path, file, tmp_path, what)
            capsys.readouterr()


_DAY = 86_400_000 * MS
# Of this century, of another, and at the ends of what can be written.
_NEAR = st.builds(lambda day, tick: BEGIN + day * _DAY + tick * 10 * MS, st.integers(-2, 2), st.integers(0, 60))
_EDGES = st.sampled_from([0, 1, 5_000 * MS, 2**31 * 10**9 - 1, 2**31 * 10**9, 2**62 - 1, 2**62, 2**63 - 1])
_STAMPS = st.one_of(_NEAR, _EDGES, st.integers(-(2**31) * 10**9, 2**31 * 10**9)).map(
    lambda stamp: max(-(2**31) * 10**9, min(2**31 * 10**9 - 1, stamp))
)
_RECEIVED = {
    StoragePlugin.MCAP: st.one_of(_NEAR, _EDGES, st.integers(0, 2**64 - 1)),
    StoragePlugin.SQLITE3: st.one_of(_NEAR, _EDGES, st.integers(-(2**63), 2**63 - 1)),
}
_POLICIES = [
    *({"policy": policy} for policy in ("approximate_time", "approximate_time_eager", "approximate_epsilon_time")),
    {"policy": "latest_time", "trigger": "/camera"},
    {"policy": "equal_key", "key": "header.frame_id"},
]
_DURATIONS = st.sampled_from(["0ms", "5ms", "10s", "9223372036s"])
_OFFSETS = st.sampled_from(["0ms", "3ms", "-86400s", "9223372036s", "-9223372036s"])


@st.composite
def _recordings(draw: st.DrawFn) -> tuple[StoragePlugin, list[Frame]]:
    plugin = draw(st.sampled_from(list(_RECEIVED)))
    messages = st.tuples(st.sampled_from(_TOPICS), _STAMPS, _RECEIVED[plugin])
    frames = [Frame(topic, VECTOR, time, vector(stamp)) for topic, stamp, time in draw(st.lists(messages, max_size=24))]
    # A simulation's clock begins at 0.
    begin = draw(st.sampled_from([BEGIN, 0]))
    return plugin, [Frame(topic, VECTOR, begin, vector(BEGIN)) for topic in _TOPICS] + frames


@st.composite
def _files(draw: st.DrawFn) -> str:
    topics = inputs(dict.fromkeys(_TOPICS, VECTOR))
    for topic in topics:
        topic |= {"offset": draw(_OFFSETS), "stamp": draw(st.sampled_from(["header", "receive"]))}
    group = draw(st.sampled_from(_POLICIES))
    thinned = st.fixed_dictionaries(
        {"restamp": st.sampled_from(["none", "earliest", "latest"])},
        optional={"max_wait": _DURATIONS, "max_rate": st.sampled_from([1, 0.001])},
    )
    slop = {"slop": draw(_DURATIONS)} if group["policy"].startswith("approximate") else {}
    if slop == {"slop": "0ms"}:
        # A time of arrival equals no other stamp, so such a file is refused.
        topics = [{**topic, "stamp": "header"} for topic in topics]
    return config({"front": {**group, **slop, **draw(thinned), "topics": topics}})


@pytest.mark.timeout(chosen(short=600, long=3600))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(recording=_recordings(), text=_files())
def test_no_time_that_a_recording_can_hold_stops_a_command(recording, text, capsys):
    load_text(text)
    plugin, frames = recording
    with TemporaryDirectory() as name:
        folder = Path(name)
        file = folder / "f.yaml"
        file.write_text(text)
        if plugin is StoragePlugin.MCAP:
            bag = write_mcap(folder / "rig.mcap", frames, chunk_size=200)
        else:
            bag = write_rosbag2(folder / "rig", frames)
        _read_by_all(bag, file, folder, f"these times: {[(frame.topic, frame.time) for frame in frames]}")
    capsys.readouterr()
