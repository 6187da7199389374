"""Every console block of the tutorials and how-to pages, run word for word: see tests/consoles.py."""

import shutil
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

import numpy as np
import pytest

from tests.cli.command import run
from tests.consoles import Reader, blocks_of, commands_of, is_like, is_live
from tests.faults.extent import IS_LONG, chosen
from tests.recordings.bag.making import write_mcap
from tests.recordings.datasets.drives import START, image, joints
from tests.ros.cdr_messages import STORE, serialize
from tests.ros.domain import claimed_domain
from tests.ros.frames import Frame
from tests.ros.streams import MS

_ROOT: Final = Path(__file__).parents[1]
_TUTORIAL: Final = _ROOT / "docs/tutorial"
_HOWTO: Final = {path.name: path.read_text() for path in sorted((_ROOT / "docs/howto").glob("*.md"))}
_BLOCKS: Final = {name: [each for each in blocks_of(page) if each.kind == "console"] for name, page in _HOWTO.items()}
_README_FILE: Final = next(each.text for each in blocks_of((_ROOT / "README.md").read_text()) if each.kind == "yaml")
_GROUP: Final = """\
  {name}:
    policy: approximate_time
    slop: 20ms
    topics:
      - {{topic: {first}, type: sensor_msgs/msg/{type}}}
      - {{topic: /demo/lidar/points, type: sensor_msgs/msg/PointCloud2}}
"""
_FRONT: Final = _GROUP.format(name="front", first="/demo/camera/image_raw", type="Image")
_REAR: Final = _GROUP.format(name="rear", first="/demo/imu/data", type="Imu")
_GROUPS: Final = "version: 1\ngroups:\n"
_HEAD: Final = "version: 1\nmetrics: {hosts: [robot]}\ngroups:\n"
_TESTS: Final = """\
version: 1
config: ../fusion.yaml
cases:
  each sweep leaves with the nearest frame:
    group: front
    drawing: |
      image_raw |a..b..c
      points    |.A.....
      -> b: aA
"""
# The files that the pages assume, for the demo's rig.
_FILES: Final = {
    "fusion.yaml": _HEAD + _FRONT + _REAR,
    "new.yaml": (_HEAD + _FRONT + _REAR).replace("20ms", "30ms"),
    **{
        f"{folder}{name}.yaml": text
        for folder in ("", "conf/", "new-conf/")
        for name, text in (("front", _HEAD + _FRONT), ("rear", _GROUPS + _REAR))
    },
    "config/fusion.yaml": _HEAD + _FRONT,
    "config/tests/fusion.yaml": _TESTS,
    "tests/fusion.yaml": _TESTS,
    "monday.txt": "bags\n",
}
_RECORDINGS: Final = (
    "monday",
    "tuesday",
    "wednesday",
    "drive",
    "day",
    "bags/a",
    "bags/deep/b",
    "fleet/r1/mon/a",
    "fleet/r2/mon/a",
)


def _yaml_of(page: str, number: int) -> str:
    return [block.text for block in blocks_of(_HOWTO[page]) if block.kind == "yaml"][number]


_LAYOUT: Final = STORE.types["std_msgs/msg/MultiArrayLayout"]([], 0)
# Pages that read a recording of 30 s several times.
_SLOW: Final = ("choose_policy_slop_queue.md", "recordings.md")
# Pages with one block that is not run.
_MARKED: Final = ("first_hour.md", "fleet.md", "observe.md", "reload.md", "testing.md")
# Pages whose reader has a relay running.
_RELAY_RUNS: Final = ("lossy_networks.md", "observe.md", "reload.md")
# Further files of a page, or other ones in their place.
_OF_PAGE: Final = {
    "before_a_message_flows.md": {"fusion.yaml": _HEAD + _FRONT},
    "files.md": {"fusion.yaml": _README_FILE, "new.yaml": _README_FILE.replace("20ms", "30ms")},
    "lerobot.md": {"fusion.yaml": _yaml_of("lerobot.md", 0)},
    "observe.md": {"fusion.yaml": _HEAD + _FRONT + _REAR.replace("/demo/imu", "/imu")},
    "testing.md": {
        "fusion.yaml": _README_FILE,
        # Its cases that need no recording.
        "tests/fusion.yaml": _yaml_of("testing.md", 1)
        .partition("  a lidar that dies")[0]
        .replace("drop: 1%", "drop: 10%"),
    },
}


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the files and recordings that the how-to pages assume."""
    folder = tmp_path_factory.mktemp("world")
    for name, text in _FILES.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    recorded = {"short.mcap": "2"} | chosen(short={}, long={"rig.mcap": "30"})
    for words in (*(("--record", name, "--seconds", lasts) for name, lasts in recorded.items()), ("--show-config",)):
        done = run("demo", *words, folder=folder)
        assert done.returncode == 0, done.stderr
    (folder / "demo.yaml").write_text(done.stdout)
    for name in (*_RECORDINGS, *chosen(short=("rig",), long=())):
        path = folder / f"{name}.mcap"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.hardlink_to(folder / "short.mcap")
    return folder


def _copied(world: Path, folder: Path, page: str) -> Path:
    shutil.copytree(world, folder)
    for name, text in _OF_PAGE.get(page, {}).items():
        (folder / name).write_text(text)
    return folder


def _joints(folder: Path) -> None:
    """A recording with the topics of the page on LeRobot."""
    frames = []
    for n in range(30):
        messages = {
            ("/camera/image_raw", "sensor_msgs/msg/Image"): image(n * 33),
            ("/joint_states", "sensor_msgs/msg/JointState"): joints(n * 33),
            ("/gripper", "std_msgs/msg/Float32"): serialize("std_msgs/msg/Float32", n),
            ("/cmd", "std_msgs/msg/Float64MultiArray"): serialize(
                "std_msgs/msg/Float64MultiArray", _LAYOUT, np.array([n, 2.0])
            ),
        }
        frames += [Frame(topic, type_name, START + n * 33 * MS, each) for (topic, type_name), each in messages.items()]
    (folder / "drives").mkdir()
    write_mcap(folder / "drives/monday.mcap", frames)


def test_the_tutorial_on_a_recording_does_what_it_says(tmp_path):
    pytest.importorskip("pyarrow")
    reader = Reader(tmp_path, domain=0, may_replace=False)
    reader.read((_TUTORIAL / "recording.md").read_text())
    assert len(reader.ran) == 11


@pytest.mark.faults
@pytest.mark.parametrize(
    "page",
    [name for name, blocks in _BLOCKS.items() if any(not is_live(each) and each.reason is None for each in blocks)],
)
def test_the_consoles_of_a_page_that_need_no_ros_do_what_they_say(page, world, tmp_path):
    if page in _SLOW and not IS_LONG:
        pytest.skip("takes 6 s of CPU: `make faults` does it")
    reader = Reader(_copied(world, tmp_path / "here", page), domain=0, may_replace=True)
    if page == "lerobot.md":
        pytest.importorskip("av")
        _joints(reader.folder)
    reader.read(_HOWTO[page], takes=lambda block: not is_live(block))
    assert reader.ran


def test_what_is_not_run_says_why_and_is_counted(figures):
    pages = {**_HOWTO, **{path.name: path.read_text() for path in _TUTORIAL.glob("*.md")}}
    blocks = [(name, block) for name, page in pages.items() for block in blocks_of(page)]
    consoles = [block for _, block in blocks if block.kind == "console"]
    commands = [line for block in consoles for line in commands_of(block)]
    skipped = [line for block in consoles if block.reason for line in commands_of(block)]
    figures(f"console blocks of tutorials and how-to pages: {len(commands)} commands, {len(skipped)} of them not run")
    assert len(skipped) == 2
    # Texts that are no output of a block are marked too.
    assert Counter(name for name, block in blocks if block.reason) == dict.fromkeys(_MARKED, 1)


@pytest.mark.parametrize(
    ("shown", "found", "alike"),
    [
        ("front: OK, 9.79 of 9.89 sets, 162 sets", "front: OK, 8 of 9 sets, 7 sets", True),
        ("front: OK", "front: WARN", False),
        ("no set for 5 s: why", "no set for 15 s: why", False),
        ("no set for 15 s: why ...", "no set for 16 s: why, and more", True),
        ("no set for 15 s: why ...", "no set for 16 s: how, and more", False),
        ("span p50 663 us, 12 ms without it", "span p50 0.7 ms, 11 ms without it", True),
        ("span 9 ms", "span 90 ms", False),
        ("at http://127.0.0.1:9464", "at http://127.0.0.1:9465", False),
    ],
)
def test_a_line_is_like_another_but_for_measured_figures(shown, found, alike):
    assert is_like(shown, found) is alike


@contextmanager
def _own_network() -> Iterator[list[str]]:
    """Yield words that, put before a command, run it in a network namespace of its own, with a host called robot.

    So the ports that pages name are free, and `top` finds no relay of another test.
    """
    with TemporaryDirectory() as folder:
        hosts = Path(folder) / "hosts"
        hosts.write_text("127.0.0.1 localhost robot\n")
        script = f"mount --bind {hosts} /etc/hosts && exec {sys.executable} -c '{_UP}'"
        words = ["/usr/bin/unshare", "--user", "--map-root-user", "--net", "--mount", "/bin/bash", "-c", script]
        holder = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        with holder:
            assert holder.stdin is not None
            assert holder.stdout is not None
            if holder.stdout.readline() != b"up\n":
                pytest.skip("no network of its own can be made here")
            spaces = ["--user", "--net", "--mount", "--preserve-credentials"]
            yield ["/usr/bin/nsenter", "--target", str(holder.pid), *spaces]
            holder.stdin.close()


# Sets the flag IFF_UP of the loopback device, and waits.
_UP: Final = """
import fcntl, socket, struct, sys
with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as made:
    fcntl.ioctl(made, 0x8914, struct.pack("16sh14x", b"lo", 1))
print("up", flush=True)
sys.stdin.read()
"""


@pytest.mark.ros
@pytest.mark.faults
@pytest.mark.skipif(
    not IS_LONG, reason="what its screens show takes a machine that does nothing else: `make faults` does it"
)
def test_the_tutorial_of_the_first_hour_does_what_it_says(tmp_path, ros_domain):
    with _own_network() as inside:
        reader = Reader(tmp_path, domain=ros_domain, may_replace=False, inside=inside)
        reader.read((_TUTORIAL / "first_hour.md").read_text())
    assert len(reader.ran) == 9


@pytest.mark.ros
@pytest.mark.faults
@pytest.mark.skipif(not IS_LONG, reason="takes minutes: `make faults` does it")
def test_the_consoles_of_pages_that_need_a_robot_do_what_they_say(world, tmp_path, figures):
    commands = 0
    with claimed_domain() as domain, _own_network() as inside:
        for page, blocks in _BLOCKS.items():
            if not any(is_live(each) and each.reason is None for each in blocks):
                continue
            reader = Reader(_copied(world, tmp_path / page, page), domain=domain, may_replace=True, inside=inside)
            relay = ["syncrelay --config fusion.yaml"] if page in _RELAY_RUNS else []
            reader.read(_HOWTO[page], takes=is_live, first=["syncrelay demo --seconds 3000", *relay])
            commands += len(reader.ran)
    figures(f"console blocks of the how-to pages: {commands} commands beside a simulated robot")
    assert commands > 30
