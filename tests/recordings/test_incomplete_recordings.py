"""A recording of which something is missing is never taken for a whole one, by any command that reads recordings."""

import json
import random
from dataclasses import dataclass
from pathlib import Path

import pytest
import yaml
from mcap.writer import CompressionType
from rosbags.rosbag2 import CompressionMode

from tests.cli.command import run, run_here
from tests.faults.extent import chosen
from tests.recordings.bag.making import rig, rig_file, write_mcap, write_rosbag2
from tests.ros.cdr_messages import VECTOR
from tests.ros.frames import Frame

pytestmark = pytest.mark.faults

COUNT = chosen(short=14, long=300)
SEED = 28
LEROBOT = {"fps": 10, "task": "drive", "max_gap": "60s", "features": {"action": "/camera:vector"}}


@dataclass(frozen=True)
class Drawn:
    """A recording that was made, what was done to it, and whether it is still whole."""

    path: Path
    what: str
    is_whole: bool


def draw(folder: Path, count: int) -> list[Drawn]:
    chance = random.Random(SEED)
    return [_one(folder, f"r{number:03}", chance) for number in range(count)]


def _one(folder: Path, name: str, chance: random.Random) -> Drawn:
    if chance.random() < 0.5:
        path = _file(folder, name, chance)
        if chance.random() < 0.3:
            return Drawn(path, f"{path.suffix} as it was written", is_whole=True)
        size, end = path.stat().st_size, _end_of_messages(path)
        kept = chance.randrange(1, size)
        with path.open("r+b") as file:
            file.truncate(kept)
        return Drawn(path, f"{path.suffix} cut off at byte {kept} of {size}", is_whole=kept >= end)
    path, what, is_whole = folder / name, "as it was written", True
    parts, suffix = _split(path, chance)
    match chance.choice(("whole", "a part is gone", "messages are gone", "parts are renamed")):
        case "a part is gone":
            gone = chance.choice(parts)
            gone.unlink()
            what, is_whole = f"{gone.name} is gone", False
        case "messages are gone":
            fewer = chance.choice(parts)
            _write(fewer, _frames(fewer, parts)[chance.randrange(1, 4) :])
            what, is_whole = f"messages of {fewer.name} are gone", False
        case "parts are renamed":
            for part in parts:
                part.rename(part.with_name(part.name.replace(name, "drive")))
            what = "all parts were renamed"
    return Drawn(path, f"{len(parts)} parts of {suffix}: {what}", is_whole=is_whole)


def _file(folder: Path, name: str, chance: random.Random) -> Path:
    frames = rig(chance.randrange(10, 40))
    if chance.random() < 0.3:
        mode = chance.choice((CompressionMode.NONE, CompressionMode.MESSAGE))
        (made,) = write_rosbag2(folder / f".{name}", frames, mode=mode).glob("*.db3")
        made.rename(folder / f"{name}.db3")
        return folder / f"{name}.db3"
    compression = chance.choice((CompressionType.NONE, CompressionType.ZSTD))
    return write_mcap(
        folder / f"{name}.mcap", frames, chunk_size=chance.choice((500, 100_000)), compression=compression
    )


def _end_of_messages(path: Path) -> int:
    """Where what follows holds no message: an MCAP file's summary, to which its footer leads."""
    content = path.read_bytes()
    return int.from_bytes(content[-28:-20], "little") if path.suffix == ".mcap" else len(content)


def _frames(part: Path, parts: list[Path]) -> list[Frame]:
    frames, size = rig(40), 80 // len(parts)
    at = parts.index(part) * size
    return frames[at:] if part == parts[-1] else frames[at : at + size]


def _write(part: Path, frames: list[Frame]) -> None:
    part.unlink(missing_ok=True)
    if part.suffix == ".mcap":
        write_mcap(part, frames)
        return
    (made,) = write_rosbag2(part.with_suffix(".made"), frames).glob("*.db3")
    made.rename(part)
    (part.with_suffix(".made") / "metadata.yaml").unlink()
    part.with_suffix(".made").rmdir()


def _split(folder: Path, chance: random.Random) -> tuple[list[Path], str]:
    """A rosbag2 folder of several files, with the metadata.yaml that rosbag2 writes; those that hold messages."""
    folder.mkdir()
    suffix = chance.choice((".mcap", ".db3"))
    parts = [folder / f"{folder.name}_{number}{suffix}" for number in range(chance.randrange(2, 5))]
    held = [_frames(part, parts) for part in parts]
    for part, frames in zip(parts, held, strict=True):
        _write(part, frames)
    listed = list(zip(parts, map(len, held), strict=True))
    if chance.random() < 0.4:
        # The recorder ended just after it had begun another file.
        listed.append((folder / f"{folder.name}_{len(parts)}{suffix}", 0))
        _write(listed[-1][0], [])
    topics = [
        {"topic_metadata": {"name": name, "type": VECTOR, "offered_qos_profiles": []}, "message_count": 40}
        for name in ("/camera", "/lidar")
    ]
    about = {
        "version": 9,
        "message_count": 80,
        "topics_with_message_count": topics,
        "relative_file_paths": [part.name for part, _ in listed],
        "files": [{"path": part.name, "message_count": count} for part, count in listed],
    }
    if chance.random() < 0.3:
        # As before version 5.
        del about["files"]
    (folder / "metadata.yaml").write_text(yaml.safe_dump({"rosbag2_bagfile_information": about}))
    return parts, suffix


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("incomplete")
    (folder / "bags").mkdir()
    (folder / "f.yaml").write_text(rig_file())
    exported = json.loads(rig_file()) | {"export": {"lerobot": LEROBOT}}
    (folder / "lerobot.yaml").write_text(json.dumps(exported))
    return folder


@pytest.fixture(scope="module")
def drawn(folder) -> list[Drawn]:
    return draw(folder / "bags", COUNT)


def test_replay_analyze_and_init_say_what_is_missing_and_exit_1(drawn, folder, figures):
    for each in drawn:
        name = str(each.path.relative_to(folder))
        for words in (
            ["replay", name, "--config", "f.yaml"],
            ["analyze", name, "--config", "f.yaml"],
            ["analyze", name],
            ["init", "--from-bag", name],
        ):
            done = run_here(*words, folder=folder)
            context = (SEED, words, each.what, done.stderr)
            assert done.returncode == (0 if each.is_whole else 1), context
            assert (name in done.stderr) == (not each.is_whole), context
    figures(f"{len(drawn)} recordings drawn, {sum(each.is_whole for each in drawn)} of them whole (seed {SEED})")


@pytest.mark.parametrize(
    ("command", "file"),
    [
        (("fleet replay", "--into"), "f.yaml"),
        (("fleet analyze", "--into"), "f.yaml"),
        (("export", "-o"), "f.yaml"),
        (("export", "--format", "lerobot", "-o"), "lerobot.yaml"),
    ],
)
def test_a_fleet_names_each_incomplete_recording_and_exits_1(command, file, drawn, folder):
    name, *options = command
    out = f"out-{'-'.join(command)}"
    done = run(*name.split(), "bags", "--config", file, *options, out, folder=folder)
    assert done.returncode == 1, done.stderr
    said = {line.removeprefix("syncrelay: ") for line in done.stderr.splitlines()}
    for each in drawn:
        is_said = any(str(each.path) in line for line in said)
        assert is_said == (not each.is_whole), f"{SEED} {each.what}\n{done.stderr}"
    (summary,) = (line for line in (done.stdout + done.stderr).splitlines() if f": {len(drawn)} recordings: " in line)
    assert "with problems" in summary or "failed" in summary, summary
    if "lerobot" in command:
        whole = sum(each.is_whole for each in drawn)
        assert f": {whole} episodes with" in done.stdout, done.stdout


def test_lerobot_keeps_incomplete_recordings_where_the_file_says_so(folder, tmp_path):
    text = json.loads((folder / "lerobot.yaml").read_text())
    write_mcap(tmp_path / "cut.mcap", rig(40), chunk_size=500)
    with (tmp_path / "cut.mcap").open("r+b") as file:
        file.truncate(7_000)
    (tmp_path / "f.yaml").write_text(json.dumps(text))
    left_out = run("export", "cut.mcap", "--config", "f.yaml", "--format", "lerobot", "-o", "out", folder=tmp_path)
    assert (left_out.returncode, left_out.stdout) == (1, "")
    assert "cut.mcap: cut off or damaged at byte" in left_out.stderr
    assert "`incomplete: keep`" in left_out.stderr
    text["export"]["lerobot"]["incomplete"] = "keep"
    (tmp_path / "f.yaml").write_text(json.dumps(text))
    kept = run("export", "cut.mcap", "--config", "f.yaml", "--format", "lerobot", "-o", "kept", folder=tmp_path)
    assert kept.returncode == 1
    assert ": 1 episode with" in kept.stdout
    assert "cut off or damaged at byte" in kept.stderr
