"""Whatever time messages say they were made or received at, what reads them ends, in words, and soon."""

from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rosbags.rosbag2 import StoragePlugin

from syncrelay.config import load_text
from tests.faults.extent import chosen
from tests.recordings.bag.making import write_mcap, write_rosbag2
from tests.recordings.in_process import read_by_all
from tests.ros.cdr_messages import VECTOR, vector
from tests.ros.configs import config, inputs
from tests.ros.frames import Frame
from tests.ros.streams import BEGIN, MS

pytestmark = pytest.mark.faults

_TOPICS = ("/camera", "/lidar")
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
    return plugin, [Frame(topic, VECTOR, BEGIN, vector(BEGIN)) for topic in _TOPICS] + frames


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
        read_by_all(bag, file, folder, f"these times: {[(frame.topic, frame.time) for frame in frames]}")
    capsys.readouterr()
