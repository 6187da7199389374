"""Recordings in object storage, read by the command line in processes of its own from servers of this machine."""

import json
import os
import socket
from contextlib import suppress
from pathlib import Path
from socketserver import BaseRequestHandler, ThreadingTCPServer
from threading import Thread

import pytest

from tests.cli.command import run, run_python
from tests.recordings.bag.making import rig, write_mcap, write_rosbag2
from tests.recordings.bag.test_storage import rig_with_images
from tests.ros.cdr_messages import VECTOR

pytestmark = pytest.mark.storage

_CONFIG = f"""\
version: 1
groups:
  rig:
    policy: approximate_time
    slop: 10ms
    topics:
      - {{topic: /camera, type: {VECTOR}}}
      - {{topic: /lidar, type: {VECTOR}}}
"""
_KEY = "hush-hush"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "f.yaml").write_text(_CONFIG)
    return tmp_path


@pytest.fixture(scope="module")
def moto():
    pytest.importorskip("s3fs", reason="the extra `fleet` is not installed")
    pytest.importorskip("boto3", reason="moto is not installed: pip install 'moto[server,s3]'")
    server = pytest.importorskip("moto.server", reason="moto is not installed: pip install 'moto[server,s3]'")
    running = server.ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    running.start()
    yield running.get_host_and_port()[1]
    running.stop()


class CountingRelay(ThreadingTCPServer):
    """A relay of TCP in front of a server, which counts the bytes that come back."""

    daemon_threads = True

    def __init__(self, port: int) -> None:
        super().__init__(("127.0.0.1", 0), _Relayed)
        self.to = ("127.0.0.1", port)
        self.received = 0


class _Relayed(BaseRequestHandler):
    server: CountingRelay

    def handle(self) -> None:
        with socket.create_connection(self.server.to) as answering, suppress(OSError):
            Thread(target=self._ask, args=(answering,), daemon=True).start()
            while content := answering.recv(65536):
                self.server.received += len(content)
                self.request.sendall(content)

    def _ask(self, answering: socket.socket) -> None:
        with suppress(OSError):
            while content := self.request.recv(65536):
                answering.sendall(content)
            answering.shutdown(socket.SHUT_WR)


@pytest.fixture
def relay(moto, monkeypatch):
    """A relay to S3, which the environment leads to; the bucket `fleet` is there."""
    import boto3  # noqa: PLC0415  optional

    counting = CountingRelay(moto)
    Thread(target=counting.serve_forever).start()
    settings = {
        "AWS_ENDPOINT_URL": f"http://127.0.0.1:{counting.server_address[1]}",
        "AWS_ACCESS_KEY_ID": "AKIATEST",
        "AWS_SECRET_ACCESS_KEY": _KEY,
        "AWS_DEFAULT_REGION": "us-east-1",
        "AWS_EC2_METADATA_DISABLED": "true",
        "NO_PROXY": "127.0.0.1",
    }
    for name, value in settings.items():
        monkeypatch.setenv(name, value)
    bucket = boto3.resource("s3").Bucket("fleet")
    bucket.create()
    yield counting
    bucket.objects.delete()
    bucket.delete()
    counting.shutdown()
    counting.server_close()


def put(folder: Path, below: str) -> None:
    """Upload a file, or all in a folder."""
    import boto3  # noqa: PLC0415  optional

    for path in sorted(folder.iterdir()) if folder.is_dir() else [folder]:
        boto3.client("s3").upload_file(str(path), "fleet", f"{below}/{path.name}")


def sets_of(bag: str, folder: Path) -> tuple[list[object], str]:
    done = run("replay", bag, "--config", "f.yaml", "--json", folder=folder)
    assert done.returncode == 0, done.stderr
    return [json.loads(line) for line in done.stdout.splitlines()], done.stderr


def test_of_a_recording_with_images_a_small_part_is_fetched_and_the_sets_are_the_same(folder, relay: CountingRelay):
    path = write_mcap(folder / "rig.mcap", rig_with_images(40))
    put(path, "day")
    relay.received = 0
    far, said = sets_of("s3://fleet/day/rig.mcap", folder)
    assert relay.received < 0.15 * path.stat().st_size
    near, _ = sets_of("rig.mcap", folder)
    assert far == near
    assert len(far) == 39
    assert "copied" not in said


@pytest.mark.parametrize(
    ("word", "why"),
    [
        ("s3://fleet/day/none.mcap", "no such file, folder or bucket: check the URL"),
        ("s3://no-such-bucket/rig.mcap", "no such file, folder or bucket: check the URL"),
        ("s3://fleet/day/none*.mcap", "holds no recording"),
    ],
)
def test_what_is_not_there_is_said_without_a_secret(word, why, folder, relay):  # noqa: ARG001  the bucket
    done = run("replay", word, "--config", "f.yaml", folder=folder)
    assert (done.returncode, done.stdout) == (1, "")
    assert f"{word}: {why}" in done.stderr
    assert _KEY not in done.stderr
    assert "Traceback" not in done.stderr


def test_where_no_credentials_are_found_that_is_said(folder, relay, monkeypatch):  # noqa: ARG001  the endpoint
    for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"):
        monkeypatch.delenv(name)
    environ = {"AWS_CONFIG_FILE": os.devnull, "AWS_SHARED_CREDENTIALS_FILE": os.devnull, "HOME": str(folder)}
    done = run("replay", "s3://fleet/rig.mcap", "--config", "f.yaml", folder=folder, environ=environ)
    assert done.returncode == 1
    assert "no credentials were found" in done.stderr


_FOUND = """
import sys
from syncrelay.recordings.bag.storage import find
for word in sys.argv[1:]:
    print(*find(word))
"""


def test_recordings_are_found_below_folders_and_by_patterns(folder, relay):  # noqa: ARG001  the bucket
    for name in ("a_2.mcap", "a_10.mcap"):
        put(write_mcap(folder / name, rig(2)), "day")
    (folder / "notes.txt").write_text("none")
    put(folder / "notes.txt", "day")
    put(write_rosbag2(folder / "rig", rig(2)), "day/rig")
    files, run_of_rosbag2 = ["s3://fleet/day/a_2.mcap", "s3://fleet/day/a_10.mcap"], ["s3://fleet/day/rig"]
    found = {
        "s3://fleet": files + run_of_rosbag2,
        "s3://fleet/day/": files + run_of_rosbag2,
        "s3://fleet/day/*": files + run_of_rosbag2,
        "s3://fleet/**/*.mcap": files,
        "s3://fleet/day/rig/metadata.yaml": run_of_rosbag2,
        "s3://fleet/day/a_2.mcap": files[:1],
    }
    done = run_python("-c", _FOUND, *found, folder=folder)
    assert [line.split() for line in done.stdout.splitlines()] == list(found.values()), done.stderr


_ROWS = """
import fsspec, pyarrow.dataset
print(pyarrow.dataset.dataset("fleet/tables", filesystem=fsspec.filesystem("s3")).count_rows())
"""


def test_results_are_written_to_a_bucket_and_read_back(folder, relay):  # noqa: ARG001  the bucket
    write_mcap(folder / "rig.mcap", rig())
    for name in ("sets.mcap", "sets"):
        done = run("replay", "rig.mcap", "--config", "f.yaml", "-o", f"s3://fleet/out/{name}", folder=folder)
        assert done.returncode == 0, done.stderr
        far = run("analyze", f"s3://fleet/out/{name}", "--json", folder=folder)
        assert {each["messages"] for each in json.loads(far.stdout)["topics"]} == {39}, far.stdout
    words = ["export", "rig.mcap", "--config", "f.yaml", "-o", "s3://fleet/tables"]
    assert run(*words, folder=folder).stdout == "s3://fleet/tables: 1 recording: 1 done\n"
    assert run(*words, folder=folder).stdout == "s3://fleet/tables: 1 recording: 1 done before\n"
    assert run_python("-c", _ROWS, folder=folder).stdout == "39\n"
    done = run("replay", "rig.mcap", "--config", "f.yaml", "-o", "s3://no-such-bucket/out.mcap", folder=folder)
    assert (done.returncode, "there is no bucket no-such-bucket" in done.stderr) == (1, True)


def test_google_cloud_storage_gives_the_same_sets(folder, monkeypatch):
    pytest.importorskip("gcsfs", reason="the extra `fleet` is not installed")
    emulator = pytest.importorskip(
        "gcp_storage_emulator.server", reason="no emulator: pip install gcp-storage-emulator"
    )
    server = emulator.create_server("127.0.0.1", 0, in_memory=True, default_bucket="fleet")
    server.start()
    try:
        port = server._api._httpd.server_address[1]  # noqa: SLF001  it tells its port nowhere else
        monkeypatch.setenv("STORAGE_EMULATOR_HOST", f"http://127.0.0.1:{port}")
        monkeypatch.setenv("FSSPEC_GS_TOKEN", "anon")
        # The kind of a bucket is asked for by gRPC, which no emulator speaks.
        monkeypatch.setenv("GCSFS_EXPERIMENTAL_ZB_HNS_SUPPORT", "false")
        path = write_mcap(folder / "rig.mcap", rig_with_images(40))
        _put_in_google(path, port)
        assert sets_of("gs://fleet/day/rig.mcap", folder)[0] == sets_of("rig.mcap", folder)[0]
    finally:
        server.stop()


def _put_in_google(path: Path, port: int) -> None:
    from urllib.request import Request, urlopen  # noqa: PLC0415  here alone

    url = f"http://127.0.0.1:{port}/upload/storage/v1/b/fleet/o?uploadType=media&name=day/{path.name}"
    with urlopen(Request(url, data=path.read_bytes(), method="POST")) as answer:
        assert answer.status == 200
