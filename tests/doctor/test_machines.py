"""The doctor in environments that have the fault, from the command line."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests import preloaded
from tests.cli.command import BAD, GOOD, ROOT, run_here
from tests.doctor.environments import OURS, distribution, site_with, unshared

# Nothing that whoever runs the tests has chosen; on a domain of its own the doctor is alone.
UNSET = ("RMW_IMPLEMENTATION", "ROS_LOCALHOST_ONLY", "ROS_STATIC_PEERS", "FASTDDS_BUILTIN_TRANSPORTS", "ROS_DOMAIN_ID")


@pytest.fixture
def base(tmp_path):
    kept = {name: value for name, value in os.environ.items() if name not in UNSET}
    return {**kept, **preloaded.PYTHON, "ROS_LOG_DIR": str(tmp_path / "log"), "NO_COLOR": "1"}


def examine(environ, *words, command=None):
    """The exit code and what the doctor found: severity and text by code."""
    code, diagnoses = diagnosed(environ, *words, command=command)
    return code, {each["code"]: each for each in diagnoses}


def diagnosed(environ, *words, command=None):
    argv = command or [sys.executable, "-m", "syncrelay", "doctor", "--json", *words]
    done = preloaded.run(argv, environ=environ, folder=ROOT)
    assert done.stdout, done.stderr
    report = json.loads(done.stdout)
    assert done.returncode == (0 if report["ok"] else 1)
    assert report["ok"] == all(each["severity"] == "info" for each in report["diagnoses"])
    return done.returncode, report["diagnoses"]


@pytest.mark.ros
def test_where_all_is_well_it_says_so_and_exits_with_0(base):
    environ = {**base, "FASTDDS_BUILTIN_TRANSPORTS": "UDPv4"}
    done = preloaded.run([sys.executable, "-m", "syncrelay", "doctor"], environ=environ, folder=ROOT)
    assert (done.returncode, done.stderr) == (0, "")
    first, *_, last = done.stdout.splitlines()
    assert first.startswith("Python 3.")
    assert "rmw_" in first
    assert last.startswith("no problems found")


WRONG = {
    ("ROS_DOMAIN_ID", "abc"): ("domain_id", "error", "expected a number from 0 to 232"),
    ("ROS_AUTOMATIC_DISCOVERY_RANGE", "localhost"): ("discovery_range", "error", "did you mean `LOCALHOST`?"),
    ("ROS_STATIC_PEERS", "no.such.host.invalid"): ("static_peers", "error", "`no.such.host.invalid`"),
    ("FASTDDS_BUILTIN_TRANSPORTS", "UDPV4"): ("transports", "error", "did you mean `UDPv4`?"),
    ("FASTRTPS_DEFAULT_PROFILES_FILE", "/nowhere/dds.xml"): ("profiles_file", "error", "No such file"),
    ("ROS_LOG_DIR", "/proc/nowhere"): ("log_folder", "info", "/proc/nowhere (by ROS_LOG_DIR)"),
    ("SYNCRELAY_HEARTBEAT", "/nowhere/beat"): ("heartbeat", "error", "/nowhere/beat: No such file or directory"),
}


@pytest.mark.ros
def test_all_variables_that_are_wrong_are_named_at_once(base):
    _, found = examine({**base, **dict(WRONG.keys())})
    for (name, _), (code, severity, what) in WRONG.items():
        if "fast" in os.environ.get("RMW_IMPLEMENTATION", "fastrtps") or not name.startswith("FAST"):
            assert (found[code]["severity"], what in found[code]["what"]) == (severity, True), found[code]


@pytest.mark.ros
def test_a_path_that_there_is_not_is_named_beside_what_is_read_otherwise(base):
    exit_code, found = examine({**base, "ROS_DOMAIN_ID": "010", "SYNCRELAY_RECEIVE": "direct"})
    assert (exit_code, found["receive_path"]["severity"]) == (1, "error")
    assert "=direct: expected compiled or rclpy" in found["receive_path"]["what"]
    assert "is read as 8" in found["domain_id"]["what"]


@pytest.mark.ros
def test_without_the_compiled_path_it_says_what_that_costs_and_how_to_get_it(base, tmp_path):
    (tmp_path / "sitecustomize.py").write_text('import sys\nsys.modules["syncrelay.ros.compiled.path"] = None\n')
    exit_code, found = examine({**base, "PYTHONPATH": f"{ROOT}:{tmp_path}"})
    assert (exit_code, found["receive_path"]["severity"]) == (0, "info")
    assert found["receive_path"]["what"] == "messages pass through rclpy: the compiled path was not built"
    assert "a message costs about 1.5 times the CPU" in found["receive_path"]["impact"]
    assert found["receive_path"]["fix"].startswith("install a C compiler")


def bare(*words):
    """Python without site-packages and without the wheels' start-up hook."""
    return [sys.executable, "-S", "-m", "syncrelay", "doctor", "--json", *words]


def test_without_rclpy_it_says_so_first_and_checks_the_rest(base, tmp_path):
    site = site_with(tmp_path, OURS)
    environ = {**base, "PYTHONPATH": f"{ROOT}:{site}", "AMENT_PREFIX_PATH": "", "ROS_DOMAIN_ID": "x"}
    environ["ROS_DISTRO"] = "jazzy"
    (tmp_path / "f.yaml").write_text(BAD)
    _, found = examine(environ, command=bare("--live", "--config", str(tmp_path / "f.yaml")))
    assert next(iter(found)) == "no_rclpy"
    assert "though ROS 2 (jazzy) is sourced" in found["no_rclpy"]["what"]
    assert "Traceback" not in str(found)
    assert {"no_rclpy", "domain_id", "file", "not_looked"} <= set(found)


@pytest.mark.ros
def test_rclpy_without_a_middleware_is_told_from_no_rclpy(base, tmp_path):
    site = site_with(tmp_path, [*OURS, "rclpy", "rpyutils", "ament_index_python"])
    environ = {**base, "PYTHONPATH": f"{ROOT}:{site}", "AMENT_PREFIX_PATH": str(tmp_path)}
    _, found = examine(environ, command=[sys.executable, "-S", "-c", WITHOUT_PREFIX])
    assert "no_middleware" in found


# The wheels' index is found by the Python's own prefix, which an environment without them has for itself.
WITHOUT_PREFIX = (
    "import sys; sys.prefix = '/nowhere'; from syncrelay.cli import main; sys.exit(main(['doctor', '--json']))"
)


def test_an_rclpy_for_another_python_is_named_with_both(base, tmp_path):
    site = site_with(tmp_path, OURS)
    (site / "rclpy").mkdir()
    (site / "rclpy/__init__.py").write_text("")
    (site / "rclpy/_rclpy_pybind11.cpython-39-x86_64-linux-gnu.so").write_text("")
    _, found = examine({**base, "PYTHONPATH": f"{ROOT}:{site}"}, command=bare())
    assert "is built for Python 3.9, this is Python 3." in found["other_python"]["what"]


def test_a_ros_beside_its_wheels_is_one_too_many(base, tmp_path):
    distribution(tmp_path / "wheels", "ros-rclpy", "7.1.6")
    (tmp_path / "ros/share/ament_index/resource_index/packages").mkdir(parents=True)
    (tmp_path / "ros/share/ament_index/resource_index/packages/rclpy").touch()
    (tmp_path / "wheels/rclpy").mkdir()
    (tmp_path / "wheels/rclpy/__init__.py").touch()
    environ = {**base, "PYTHONPATH": f"{ROOT}:{tmp_path / 'wheels'}", "AMENT_PREFIX_PATH": str(tmp_path / "ros")}
    _, found = examine(environ)
    assert f"ROS 2 is sourced ({tmp_path / 'ros'}), and its wheels" in found["two_ros"]["what"]


@pytest.mark.ros
def test_several_files_are_examined_as_one_and_their_errors_are_shown_as_validate_shows_them(base, tmp_path):
    paths = [str(tmp_path / name) for name in ("f.yaml", "g.yaml")]
    for path, text in zip(paths, (GOOD, BAD), strict=True):
        Path(path).write_text(text)
    _, found = examine(base, "--config", paths[0], "--config", paths[1])
    validated = run_here("validate", "--together", *paths, folder=tmp_path)
    first, _, rest = found["file"]["what"].partition("\n")
    assert (first, rest) == (f"2 errors in {paths[0]} and {paths[1]}:", validated.stderr.rstrip("\n"))
    assert found["file"]["fix"].endswith(f"syncrelay validate --together {paths[0]} {paths[1]}")


@pytest.mark.ros
def test_a_missing_package_and_remaps_that_make_names_meet_are_faults_of_the_environment(base, tmp_path):
    text = GOOD.replace("/b, type: sensor_msgs", "/b, type: acme_msgs")
    (tmp_path / "f.yaml").write_text(text + "      - {topic: /c, type: sensor_msgs/msg/Image}\n")
    remaps = ("-r", "/b:=/front/a", "-r", "/front/b:=/front/c")
    _, found = examine(base, "--config", str(tmp_path / "f.yaml"), "--ros-args", *remaps)
    assert "`acme_msgs` is not installed here" in found["package_missing"]["what"]
    assert "note:" not in found["package_missing"]["what"]
    assert {"remap_loop", "remap_outputs"} <= set(found)
    assert {"file", "type_unusable"}.isdisjoint(found)


@pytest.mark.ros
def test_types_whose_libraries_do_not_load_are_named_with_their_topics(base, tmp_path):
    index = tmp_path / "share/ament_index/resource_index/rosidl_interfaces"
    index.mkdir(parents=True)
    why = "libacme.so: cannot open shared object file"
    for package, module in (("acme_msgs", f"raise ImportError({why!r})"), ("dead_msgs", "import os; os.abort()")):
        (tmp_path / package / "msg").mkdir(parents=True)
        (tmp_path / package / "__init__.py").touch()
        (tmp_path / package / "msg/__init__.py").write_text(module)
        (index / package).write_text("msg/Thing.idl\nmsg/Thing.msg\n")
        (tmp_path / "share" / package / "msg").mkdir(parents=True)
        (tmp_path / "share" / package / "msg/Thing.msg").write_text("std_msgs/Header header\n")
    text = GOOD.replace("/b, type: sensor_msgs/msg/Image", "/b, type: acme_msgs/msg/Thing")
    (tmp_path / "f.yaml").write_text(f"{text}      - {{topic: /c, type: dead_msgs/msg/Thing}}\n")
    prefixes = os.pathsep.join(filter(None, [str(tmp_path), os.environ.get("AMENT_PREFIX_PATH"), sys.prefix]))
    environ = {**base, "PYTHONPATH": f"{ROOT}:{tmp_path}", "AMENT_PREFIX_PATH": prefixes}
    _, found = diagnosed(environ, "--config", str(tmp_path / "f.yaml"))
    unusable = [each for each in found if each["code"] == "type_unusable"]
    for each, fault, topic in zip(unusable, (why, "the process was ended by signal 6"), ("/b", "/c"), strict=True):
        assert fault in each["what"]
        assert f"the relay receives nothing on {topic}, so the group front waits" in each["impact"]


@pytest.mark.ros
def test_a_start_that_fails_for_a_reason_nobody_thought_of_is_shown_with_its_words(base):
    _, found = examine({**base, "ROS_SECURITY_ENABLE": "true", "ROS_SECURITY_STRATEGY": "Enforce"}, "--live")
    assert found["no_start"]["what"].startswith("ROS does not start:\nfailed to initialize rcl")
    assert "not_looked" in found


@pytest.mark.ros
def test_arguments_that_ros_does_not_take_are_shown(base):
    _, found = examine(base, "--ros-args", "-r", "nonsense")
    assert found["ros_args"]["what"].startswith("ROS rejects --ros-args -r nonsense:")


@pytest.fixture
def tasks_allowed():
    """The folder of a control group that allows 25 processes and threads."""
    top = next((path for path in map(Path, PIDS_GROUPS) if (path / "cgroup.procs").exists()), None)
    group = (top or Path(PIDS_GROUPS[0])) / f"syncrelay-test-{os.getpid()}"
    try:
        group.mkdir()
        (group / "pids.max").write_text("25")
    except OSError:
        pytest.skip("this machine lets nobody make control groups that limit tasks")
    yield group
    group.rmdir()


PIDS_GROUPS = ("/sys/fs/cgroup/pids", "/sys/fs/cgroup")


@pytest.mark.ros
def test_too_few_processes_allowed_are_counted(base, tasks_allowed):
    script = f'echo $$ > {tasks_allowed}/cgroup.procs; exec "$@"'
    command = ["sh", "-ec", script, "sh", sys.executable, "-m", "syncrelay", "doctor", "--json"]
    _, found = examine(base, command=command)
    assert "only 25 processes and threads are allowed here" in found["task_limit"]["what"]


SHM = "mount -t tmpfs -o mode=1777 shm /dev/shm; cd /dev/shm"
# As Fast DDS 2 writes them, and as Fast DDS 3 does.
STALE = (
    "touch fastrtps_0123456789abcdef fastrtps_0123456789abcdef_el fastrtps_port7999 fastrtps_port7999_el"
    " fastdds_0123456789abcdef fastdds_0123456789abcdef_el"
)
# Of a port that no process here takes: Fast DDS would wait for whoever holds it.
LIVE = "touch fastrtps_port7499 fastrtps_port7499_el; exec 9<fastrtps_port7499_el; flock 9"
VETH = "ip link add {0} type veth peer name {0}b; ip link set {0} up; ip link set {0}b up"
UP = "ip link set lo up"
# What may be wrong at once.
FAULTS = {
    "loopback_down shm_full": "mount -t tmpfs -o size=300k shm /dev/shm",
    "no_network shm_tight": f"{UP}; mount -t tmpfs -o size=2m shm /dev/shm",
    "no_multicast shm_unusable": (
        f"{UP}; {VETH.format('wg0')}; ip link set wg0 multicast off; ip link set wg0b multicast off;"
        " mount -t tmpfs -o ro shm /dev/shm"
    ),
    "private_shm shm_empty shm_foreign": (
        f"{SHM}; touch fastrtps_port7498; {LIVE}; chown 65534 fastrtps_port7499*; mount -t tmpfs run /run;"
        f" touch /run/.containerenv; {UP}; {VETH.format('docker0')}"
    ),
}


@pytest.mark.ros
@pytest.mark.parametrize("codes", FAULTS)
def test_a_machine_that_is_set_up_wrong_is_recognised(codes, base):
    _, found = examine(base, command=unshared(["mount", "net"], FAULTS[codes], "doctor", "--json"))
    assert set(codes.split()) <= set(found)


@pytest.mark.ros
def test_what_it_says_to_do_about_stale_files_removes_them_and_no_others(base):
    made = f"{SHM}; {STALE}; {LIVE}; touch kept"
    _, found = examine(base, command=unshared(["mount"], made, "doctor", "--json"))
    assert "3 Fast DDS files" in found["shm_stale"]["what"]
    clean = found["shm_stale"]["fix"].splitlines()[-1]
    command = unshared(["mount"], f"{made}; set +e\n{clean}\nls /dev/shm >&2", "--version")
    done = subprocess.run(command, env=base, capture_output=True, text=True, timeout=120, check=False)
    assert done.stderr.split() == ["fastrtps_port7499", "fastrtps_port7499_el", "kept"]
