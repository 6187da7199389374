"""A fleet on a Ray cluster, each with network, processes and shared memory of its own: Ray opens ports to all."""

import importlib.util
import os
import shutil
import signal
import subprocess
import sys
import tempfile

import pytest

from syncrelay.cli.demo import record, shipped_config
from tests.cli.command import ROOT
from tests.faults.extent import IS_LONG
from tests.recordings.fleet.fleets import FILE, make_fleet, replay_into, tree
from tests.recordings.fleet.tasks import OBEDIENT

pytestmark = [
    pytest.mark.ray,
    pytest.mark.skipif(importlib.util.find_spec("ray") is None, reason="ray is not installed: make test-fleet"),
]

_RECORDINGS = 1000 if IS_LONG else 40
_UNSHARE = ("unshare", "--map-root-user", "--net", "--mount", "--pid", "--fork", "--kill-child", "--mount-proc")
_BEGIN = 'mount -t tmpfs tmpfs /dev/shm; ip link set lo up; ip address add 10.99.0.1/24 dev lo; exec "$@"'


@pytest.fixture
def isolated():
    """Returns what runs Python in namespaces of its own: its words, to its end."""
    if not shutil.which("ip") or subprocess.run([*_UNSHARE, "true"], capture_output=True, check=False).returncode:
        pytest.skip("this machine gives no namespaces of its own, or has no iproute2")
    # The paths of Ray's sockets may have no more than 107 bytes.
    with tempfile.TemporaryDirectory(prefix="ray", dir="/tmp") as home:
        environ = {**os.environ, "PYTHONPATH": str(ROOT), "HOME": home, "RAY_TMPDIR": home}
        environ.pop("RAY_ADDRESS", None)

        def run_isolated(*words, folder):
            command = [*_UNSHARE, "sh", "-ec", _BEGIN, "sh", sys.executable, *words]
            return subprocess.run(
                command, cwd=folder, env=environ, capture_output=True, text=True, timeout=3000, check=False
            )

        yield run_isolated


def test_it_leaves_what_this_machines_cores_leave(isolated, tmp_path):
    make_fleet(tmp_path)
    (tmp_path / "bags" / "bad.mcap").write_bytes(b"")
    local = replay_into(tmp_path, into="local")
    words = f"-m syncrelay fleet replay bags --config {FILE} --engine ray --jobs 2 --into ray".split()
    ended = isolated(*words, folder=tmp_path)
    assert (ended.returncode, ended.stdout) == (1, "ray: 4 recordings: 3 done, 1 failed\n")
    assert local.stderr in ended.stderr
    assert tree(tmp_path / "ray") == tree(tmp_path / "local")


def test_a_worker_that_dies_and_a_bug_are_their_recordings_alone(isolated, tmp_path):
    for name, text in {"a": "good", "b": "die 1", "c": "die 9", "d": "break", "e": "refuse"}.items():
        (tmp_path / f"{name}.mcap").write_text(text)
    ended = isolated("-c", OBEDIENT, "ray", ".", folder=tmp_path)
    assert (ended.returncode, ended.stdout) == (70, "out: 5 recordings: 2 done, 3 failed\n")
    assert "c.mcap: its worker was lost (WorkerCrashedError), or took longer than --time-limit, 3 times" in ended.stderr
    assert "ZeroDivisionError" in ended.stderr
    assert "e.mcap: is of no use" in ended.stderr
    assert not (tmp_path / "out" / ".partial").exists()


_SIGNALLED = """
import os, signal, subprocess, sys, time
from pathlib import Path
words = ["-c", sys.argv[2], "ray", "."]
with subprocess.Popen([sys.executable, *words], stderr=subprocess.PIPE, text=True) as command:
    while not Path("x.attempts").exists():
        assert command.poll() is None, command.stderr.read()
        time.sleep(0.02)
    os.kill(command.pid, int(sys.argv[1]))
    told = command.stderr.read() if int(sys.argv[1]) != signal.SIGKILL else ""
    code = command.wait()
end = time.monotonic() + 60

# Where Ray could not be told of the end, processes of its own that do nothing look for their cluster for a while.
idle = (b"ray::DashboardAgent", b"ray::RuntimeEnvAgent", b"ray::IDLE") if code == -signal.SIGKILL else ()

def left():
    for each in filter(str.isdigit, os.listdir("/proc")):
        try:
            title = Path("/proc", each, "cmdline").read_bytes()
        except OSError:
            continue
        # What has ended has no title, and waits for the first process of the machine, which is this one.
        if title and int(each) != os.getpid() and not title.startswith(idle):
            yield title.split(b"\\0")[0]

while found := list(left()):
    assert time.monotonic() < end, found
    time.sleep(0.05)
print(code, told)
"""


@pytest.mark.parametrize(
    ("number", "code", "told"),
    [
        (signal.SIGINT, 130, "ended by SIGINT: 1 recording: 1 not done"),
        (signal.SIGTERM, 143, "ended by SIGTERM: 1 recording: 1 not done"),
        (signal.SIGKILL, -9, ""),
    ],
)
def test_nothing_of_a_cluster_that_was_started_is_left_when_the_command_ends(number, code, told, isolated, tmp_path):
    (tmp_path / "x.mcap").write_text("hang")
    ended = isolated("-c", _SIGNALLED, str(int(number)), OBEDIENT, folder=tmp_path)
    assert ended.returncode == 0, ended.stderr
    assert ended.stdout.startswith(f"{code} ")
    assert told in ended.stdout


def test_a_cluster_that_cannot_be_reached_is_told(isolated, tmp_path):
    make_fleet(tmp_path, counts=(3,))
    script = (
        "import os, sys; from syncrelay.cli import main; os.environ['RAY_ADDRESS'] = '10.99.0.1:9'; sys.exit(main())"
    )
    words = ("fleet", "replay", "bags", "--config", FILE, "--engine", "ray", "--into", "out")
    ended = isolated("-c", script, *words, folder=tmp_path)
    assert ended.returncode == 1
    assert "syncrelay: the Ray cluster 10.99.0.1:9 of RAY_ADDRESS cannot be reached: " in ended.stderr


_TWO_NODES = """
import os, resource, signal, subprocess, sys, time
from pathlib import Path
from tests.ros.processes import children_of, wait_until

def below(pid):
    return [each for child in children_of(pid) for each in (child, *below(child))]

def title(pid):
    try:
        return Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:
        return b""

def start(*words):
    command = [sys.executable, "-m", "ray.scripts.scripts", "start", "--num-cpus=1", "--disable-usage-stats", "--block"]
    return subprocess.Popen([*command, *words], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

def lines():
    return Path("out/_ledger.jsonl").read_text().count("\\n") if Path("out/_ledger.jsonl").exists() else 0

address = "10.99.0.1:6399"
head = start("--head", "--port=6399", "--node-ip-address=10.99.0.1", "--include-dashboard=false")
import ray
os.environ["RAY_ADDRESS"] = address

def is_up():
    try:
        ray.init(address=address, log_to_driver=False, configure_logging=False)
    except Exception:
        time.sleep(0.2)
        return False
    return True

wait_until(is_up, "the head", deadline_s=300)
other = start(f"--address={address}", "--node-ip-address=10.99.0.1")
wait_until(lambda: ray.cluster_resources().get("CPU") == 2, "the other node", deadline_s=300)
ray.shutdown()
command = subprocess.Popen([sys.executable, "-m", "syncrelay", *sys.argv[2:]])
wait_until(
    lambda: lines() > int(sys.argv[1]) and any(b"perform" in title(pid) for pid in below(other.pid)),
    "a worker of the other node", deadline_s=300, poll_s=0.002,
)
for pid in (*below(other.pid), other.pid):
    os.kill(pid, signal.SIGKILL)
done = lines()
code = command.wait()
print(done, resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss // 1000)
head.terminate()
sys.exit(code)
"""


# The long form makes its recordings first, which takes most of its time.
@pytest.mark.timeout(3600)
def test_a_node_that_is_lost_midway_loses_and_doubles_nothing(isolated, tmp_path, figures):
    (tmp_path / FILE).write_text(shipped_config())
    (tmp_path / "bags").mkdir()
    for number in range(_RECORDINGS):
        record(str(tmp_path / "bags" / f"r{number}.mcap"), 1.0, number)
    words = ("fleet", "replay", "bags", "--config", FILE)
    local = [sys.executable, "-m", "syncrelay", *words, "--into", "local"]
    environ = {**os.environ, "PYTHONPATH": str(ROOT)}
    subprocess.run(local, cwd=tmp_path, env=environ, timeout=3000, check=True, capture_output=True)
    when = _RECORDINGS // 4
    ended = isolated("-c", _TWO_NODES, str(when), *words, "--engine", "ray", "--into", "out", folder=tmp_path)
    assert ended.returncode == 0, ended.stderr
    told, figures_told = ended.stdout.splitlines()
    done, megabytes = figures_told.split()
    assert told == f"out: {_RECORDINGS} recordings: {_RECORDINGS} done"
    assert when < int(done) < _RECORDINGS
    assert len((tmp_path / "out" / "_ledger.jsonl").read_text().splitlines()) == 1 + _RECORDINGS
    assert tree(tmp_path / "out") == tree(tmp_path / "local")
    figures(
        f"Ray, {_RECORDINGS} recordings on 2 nodes, one killed when {done} were done: each is there once;"
        f" the command took {megabytes} MB of memory"
    )


_ROWS = """
import ray
from syncrelay.recordings.datasets import ray_dataset, read_sets
ray.init("local", num_cpus=2, include_dashboard=False)
bags = [f"bags/r{number}.mcap" for number in range(3)]
key = lambda row: (row["recording"], row["set"])
rows = ray_dataset(bags, "f.yaml", memory=10**8).select_columns(["recording", "set", "/camera"]).take_all()
expected = [row for batch in read_sets(bags, "f.yaml") for row in batch.to_pylist()]
assert len(rows) > 80
assert sorted(rows, key=key) == [{name: row[name] for name in rows[0]} for row in expected]
"""


def test_a_dataset_of_ray_has_the_rows_that_are_read_here(isolated, tmp_path):
    make_fleet(tmp_path)
    ended = isolated("-c", _ROWS, folder=tmp_path)
    assert ended.returncode == 0, ended.stderr
