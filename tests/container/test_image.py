"""The image: what is in it, what is left out, and its commands other than the relay."""

import hashlib
import json
import tomllib
from pathlib import Path

import pytest

from syncrelay.sync.compiled import source_fingerprint
from tests.container.docker import IMAGE, docker, run_docker

pytestmark = pytest.mark.container

_ROOT = Path(__file__).parents[2]
_ALL_TYPES = """
from pathlib import Path
from importlib import import_module
index = Path("/opt/syncrelay/share/ament_index/resource_index/rosidl_interfaces")
names = [f"{package.name}.{line.removesuffix('.msg')}" for package in sorted(index.iterdir())
         for line in package.read_text().splitlines() if line.startswith("msg/") and line.endswith(".msg")]
for name in names:
    module, _, message = name.replace("/", ".").rpartition(".")
    getattr(import_module(module), message).__class__.__import_type_support__()
print(len(names))
"""
_ALL_FILES = """
import hashlib, json
from pathlib import Path
import syncrelay
root = Path(syncrelay.__file__).parent
files = {str(file.relative_to(root)): file.read_bytes() for file in root.rglob("*.py")}
print(json.dumps({name: hashlib.sha256(content).hexdigest() for name, content in files.items()}))
"""
_COMPILED = """
import json
from pathlib import Path
from syncrelay.ros.compiled import path
files = Path(path.__file__).parent.iterdir()
print(json.dumps([path.SOURCE, sorted({file.suffix for file in files})]))
"""
_FAULTY = """\
version: 1
groups:
  front:
    policy: exact_time
    slopp: 20ms
    topics:
      - {topic: /camera, type: sensor_msgs/msg/Imag}
      - {topic: /lidar, type: sensor_msgs/msg/PointCloud2}
"""


@pytest.fixture
def in_image(tmp_path: Path):
    """Runs a command of the image on the test's files, without a network."""
    tmp_path.chmod(0o755)

    def run(*words: str, options: tuple[str, ...] = ()):
        return run_docker("run", "--rm", "--network=none", f"--volume={tmp_path}:/config:ro", *options, IMAGE, *words)

    return run


def test_a_faulty_file_is_explained_in_the_container_with_the_types_that_it_has(in_image, tmp_path):
    (tmp_path / "fusion.yaml").write_text(_FAULTY)
    run = in_image("validate", "fusion.yaml")
    assert run.returncode == 1
    assert "fusion.yaml:5:5: groups.front.slopp" in run.stderr
    assert "did you mean `sensor_msgs/msg/Image`?" in run.stderr


def test_what_is_installed_is_the_code_that_was_copied(in_image):
    run = in_image("-c", _ALL_FILES, options=("--entrypoint=python3",))
    assert run.returncode == 0, run.stderr
    package = _ROOT / "syncrelay"
    files = {str(file.relative_to(package)): file.read_bytes() for file in package.rglob("*.py")}
    assert json.loads(run.stdout) == {name: hashlib.sha256(content).hexdigest() for name, content in files.items()}
    (version,) = in_image("--version").stdout.split()[1:]
    assert version == tomllib.loads((_ROOT / "pyproject.toml").read_text())["project"]["version"]


def test_the_compiled_path_is_in_the_image_without_what_it_was_made_of(in_image):
    run = in_image("-c", _COMPILED, options=("--entrypoint=python3",))
    assert run.returncode == 0, run.stderr
    assert json.loads(run.stdout) == [source_fingerprint(), ["", ".py", ".so"]]
    assert in_image("-c", "command -v gcc || true", options=("--entrypoint=sh",)).stdout == ""


def test_a_relay_without_its_file_says_so(in_image):
    run = in_image()
    assert run.returncode == 1
    assert "/config/fusion.yaml" in run.stderr


def test_the_demo_runs_in_the_container(in_image):
    # On a busy machine its processes take some seconds to discover each other.
    run = in_image("demo", "--seconds", "15")
    assert run.returncode == 0, run.stderr


def test_every_message_type_can_be_imported_after_the_trimming(in_image):
    run = in_image("-c", _ALL_TYPES, options=("--entrypoint=python3",))
    assert run.returncode == 0, run.stderr
    assert int(run.stdout) > 100


def test_what_a_relay_never_opens_is_left_out(in_image):
    of_extras = ("jinja2", "lz4", "mcap", "rich", "rosbags", "ruamel*", "textual", "zstandard")
    names = ("pip", "setuptools", "*.hpp", "*.pyi", *of_extras)
    run = in_image("/opt/syncrelay/lib", *_any_of(names), options=("--entrypoint=find",))
    assert (run.returncode, run.stdout) == (0, "")


def _any_of(names):
    first, *others = names
    return ("-name", first, *(word for name in others for word in ("-o", "-name", name)))


def test_a_command_that_reads_recordings_says_what_the_image_leaves_out(in_image, tmp_path):
    (tmp_path / "drive.mcap").write_bytes(b"")
    run = in_image("analyze", "drive.mcap")
    assert run.returncode == 69
    assert "pip install 'syncrelay[recordings]'" in run.stderr


def test_the_user_is_not_root_and_owns_nothing_of_the_program(in_image):
    assert in_image("-u", options=("--entrypoint=id",)).stdout.strip() == "1000"
    writable = in_image("/opt/syncrelay", "-writable", "-not", "-type", "l", options=("--entrypoint=find",))
    assert (writable.returncode, writable.stdout) == (0, "")


def test_the_label_says_the_version_of_the_package():
    project = tomllib.loads((_ROOT / "pyproject.toml").read_text())["project"]
    label = '{{index .Config.Labels "org.opencontainers.image.version"}}'
    assert docker("image", "inspect", "--format", label, IMAGE) == project["version"]
    description = '{{index .Config.Labels "org.opencontainers.image.description"}}'
    assert docker("image", "inspect", "--format", description, IMAGE) == project["description"]


def test_both_dockerfiles_carry_the_same_labels_and_defaults():
    def instructions(name: str, *kinds: str) -> list[str]:
        text = (_ROOT / "docker" / name).read_text().replace("\\\n", " ")
        return [" ".join(line.split()) for line in text.splitlines() if line.startswith(kinds)]

    kinds = ("LABEL", "HEALTHCHECK", "CMD", "USER", "WORKDIR /config")
    assert instructions("Dockerfile", *kinds) == instructions("Dockerfile.ros", *kinds)
