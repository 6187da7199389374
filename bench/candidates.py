"""Loads, and the relays that are measured under them."""

import json
import os
import shutil
import socket
import subprocess
import sys
import sysconfig
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
LARGE = {"FASTRTPS_DEFAULT_PROFILES_FILE": str(HERE.parent / "configs/large_messages.xml")}


@dataclass(frozen=True)
class Load:
    """Topics of a type, published at a rate, and the groups that use them.

    The topics of a set share a stamp and follow each other `apart_s`: by default so that each message wakes the
    relay, as messages of real sensors do. With `own_stamps` each has its own, and sets are the nearest messages.
    """

    type_name: str
    size: int
    rate: float
    topics: int = 2
    groups: int = 1
    shared: bool = False
    apart_s: float = 0.0002
    own_stamps: bool = False
    environ: Mapping[str, str] = field(default_factory=dict)

    @property
    def inputs(self):
        n_sources = 1 if self.shared else self.groups
        return [f"/in{number}" for number in range(self.topics * n_sources)]

    @property
    def outputs(self):
        return [f"/g{group}/out{index}" for group in range(self.groups) for index in range(self.topics)]

    @property
    def routes(self):
        """Input and output of each topic of each group."""
        inputs = self.inputs * (self.groups if self.shared else 1)
        return list(zip(inputs, self.outputs, strict=True))


LOADS = {
    "2 x 200 Hz x 1 kB": Load("Image", 1_000, 200),
    "4 x 100 Hz Imu": Load("Imu", 0, 100, topics=4),
    "9 x 50 Hz Imu": Load("Imu", 0, 50, topics=9, apart_s=0),
    "2 x 200 Hz x 1 kB, own stamps": Load("Image", 1_000, 200, own_stamps=True),
    "4 x 100 Hz Imu, own stamps": Load("Imu", 0, 100, topics=4, own_stamps=True),
    "2 x 1 kHz x 1 kB": Load("Image", 1_000, 1_000),
    "10 x 2 x 20 Hz x 1 kB": Load("Image", 1_000, 20, groups=10),
    "2 x 20 Hz x 1 MB": Load("Image", 1_000_000, 20, environ=LARGE),
    "2 x 20 Hz x 6 MB": Load("Image", 6_000_000, 20, environ=LARGE),
}


@dataclass(frozen=True)
class Candidate:
    """A relay's command under a load, and where it is started; its environment; which of its manifests are heard.

    `tap` is the command that taps it, once it is there.
    """

    name: str
    load: Load
    argv: Sequence[str]
    environ: Mapping[str, str] = field(default_factory=dict)
    folder: Path | None = None
    hear: Sequence[str] = ()
    tap: Sequence[str] = ()
    bundles: Sequence[str] = ()
    """The topics of its bundles, where its sets leave as one message each."""
    bundle_type: str = "Set"


# Scalars on /diagnostics; manifests that someone hears; neither watching nor telling; sets and drops that are tapped;
# sets as one message each.
SWITCHES = {"scalars", "heard", "untold", "tapped", "bundled"}
# How bench/floor.c is told to do the same, or to pass messages on once a set is whole.
FLOOR_MODES = {"bundled": "joined", "held": "held"}


class Workshop:
    """Makes candidates with their files in a folder; the help of compare.py explains their names."""

    def __init__(self, folder):
        self._folder, self._files, self._floor, self._built = folder, 0, None, set()

    def candidate(self, word, load):
        """Return the candidate of a name; raises ValueError if there is none, or if it cannot run here."""
        kind, _, settings = word.partition("@")
        asked = dict(setting.partition("=")[::2] for setting in settings.split(",") if setting)
        python = asked.pop("PYTHON", sys.executable)
        if kind == "c":
            modes = [mode for name, mode in FLOOR_MODES.items() if asked.pop(name, None) == ""]
            bundles = load.outputs[:1] if "joined" in modes else []
            call = [python, "-c", CALL_MAIN, str(self._built_floor()), *modes, *_words(load)]
            return Candidate(word, load, call, asked, bundles=bundles, bundle_type=load.type_name)
        if kind == "typed":
            here = {"PYTHONPATH": str(HERE.parent)}
            return Candidate(word, load, [python, str(HERE / "typed_relay.py"), *_words(load)], {**here, **asked})
        checkout = Path(kind).resolve()
        if not (checkout / "syncrelay/cli").is_dir():
            raise ValueError(f"{kind}: neither `c` nor `typed` nor a checkout of syncrelay")
        switches = {name for name, value in asked.items() if not value}
        if wrong := switches - SWITCHES:
            raise ValueError(f"{word}: no setting is called {', '.join(sorted(wrong))}")
        environ = {"PYTHONPATH": str(checkout), **{name: value for name, value in asked.items() if value}}
        port = _free_port()
        is_bundled = "bundled" in switches
        if is_bundled:
            environ |= self._with_messages(load, environ)
        command = [python, *self._entry(load, switches, port)]
        # What it prints is read by nobody else.
        follow = f'exec "$0" -m syncrelay tap --url http://127.0.0.1:{port} > /dev/null'
        tap = ["sh", "-c", follow, python] if "tapped" in switches else []
        hear = [f"/syncrelay/g{group}/sets" for group in range(load.groups)] if "heard" in switches else []
        # `-m` looks where it is started first.
        bundles = [f"/g{group}/set" for group in range(load.groups)] if is_bundled else []
        return Candidate(word, load, command, environ, checkout, hear, tap, bundles)

    def _with_messages(self, load, environ):
        """Build a message that holds a set of the load, and return what sources its package."""
        prefix = self._folder / f"messages{load.topics}{load.type_name}"
        if prefix not in self._built:
            package = self._folder / "sources" / prefix.name / "bench_msgs"
            (package / "msg").mkdir(parents=True)
            (package / "package.xml").write_text(
                "<package><name>bench_msgs</name><depend>sensor_msgs</depend></package>"
            )
            fields = "".join(f"sensor_msgs/{load.type_name} input{index}\n" for index in range(load.topics))
            (package / "msg/Set.msg").write_text(f"std_msgs/Header header\n{fields}")
            builder = HERE.parent / "docker/build_messages.py"
            subprocess.run([sys.executable, str(builder), "--into", str(prefix), str(package)], check=True)
            self._built.add(prefix)
        packages = sysconfig.get_path("purelib", vars={"base": str(prefix)})
        return {
            "AMENT_PREFIX_PATH": str(prefix),
            # With that of this process: the wheels of ROS have set it, and would not do so again.
            "LD_LIBRARY_PATH": f"{prefix / 'lib'}:{os.environ.get('LD_LIBRARY_PATH', '')}",
            "PYTHONPATH": f"{packages}:{environ['PYTHONPATH']}",
        }

    def _entry(self, load, switches, port):
        keys: dict[str, Any] = {"metrics": {"listen": f"127.0.0.1:{port}"}}
        if "scalars" in switches:
            keys["diagnostics"] = {"scalars": True}
        if "untold" in switches:
            keys = {"metrics": None, "diagnostics": None}
        self._files += 1
        path = self._folder / f"relay{self._files}.yaml"
        groups = _groups(load)
        if "bundled" in switches:
            for name, group in groups.items():
                fields = {f"input{index}": each["topic"] for index, each in enumerate(group["topics"])}
                group["topics"] = [{"topic": each["topic"], "type": each["type"]} for each in group["topics"]]
                bundle = {"topic": f"/{name}/set", "type": "bench_msgs/msg/Set", "fields": fields}
                group |= {"outputs": False, "bundle": bundle}
        path.write_text(json.dumps({"version": 1, **keys, "groups": groups}))
        return (
            [str(HERE / "untold.py"), str(path)] if "untold" in switches else ["-m", "syncrelay", "--config", str(path)]
        )

    def _built_floor(self):
        """The relay in C, compiled; raises ValueError where there is no compiler, or no headers."""
        if self._floor is None:
            self._floor = _compiled(self._folder / "floor.so")
        return self._floor


def _groups(load):
    return {
        f"g{group}": {
            "policy": "approximate_time" if load.own_stamps else "approximate_time_eager",
            "slop": "5ms",
            "topics": [
                {"topic": topic, "type": f"sensor_msgs/msg/{load.type_name}", "output": output}
                for topic, output in load.routes[group * load.topics : (group + 1) * load.topics]
            ],
        }
        for group in range(load.groups)
    }


def _words(load):
    return [word for route in load.routes for word in (load.type_name, *route)]


# The wheels' libraries want symbols of the interpreter, so it calls the C program: one call, which ends with it.
CALL_MAIN = """
import ctypes, sys
words = [word.encode() for word in sys.argv[1:]]
sys.exit(ctypes.CDLL(sys.argv[1]).main(len(words), (ctypes.c_char_p * len(words))(*words)))
"""


def _compiled(library):
    prefix = Path(sys.prefix)
    compiler = shutil.which("cc")
    if compiler is None or not (prefix / "include/rcl").is_dir():
        raise ValueError("c: there is no compiler, or no headers of rcl")
    includes = [f"-I{path}" for path in (prefix / "include").iterdir()]
    needed = ["rcl", "rmw", "rcutils", "rosidl_runtime_c", "sensor_msgs__rosidl_typesupport_c"]
    subprocess.run(
        [
            *(compiler, "-O2", "-Wall", "-shared", "-fPIC", "-o", str(library), str(HERE / "floor.c"), *includes),
            *(f"-L{prefix / 'lib'}", *(f"-l{name}" for name in needed)),
        ],
        check=True,
    )
    return library


def _free_port():
    with socket.create_server(("127.0.0.1", 0)) as server:
        return server.getsockname()[1]


def clean_environment():
    """What the bench was started with, less what would tell Fast DDS otherwise."""
    return {name: value for name, value in os.environ.items() if not name.startswith(("FASTDDS_", "FASTRTPS_"))}
