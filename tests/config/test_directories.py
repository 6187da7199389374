"""A directory in the place of a file: its YAML files run as one, in the order of their names."""

import os
from pathlib import Path

import pytest

from syncrelay.config import ConfigError, load
from syncrelay.yaml_files import MOST_FILES, yaml_files
from tests.config.test_together import FRONT, file, group

REAR = file(group("rear", "/a", "/c"))


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    Path("conf").mkdir()
    return Path("conf")


def errors(environ: dict[str, str], *paths: str) -> list[str]:
    with pytest.raises(ConfigError) as raised:
        load(*paths, environ=environ)
    return [line for line in str(raised.value).splitlines() if not line.startswith("  ")]


def test_a_directory_is_what_its_files_are_together(folder, environ):
    (folder / "20-front.yml").write_text(FRONT)
    (folder / "10-rear.yaml").write_text(REAR)
    (folder / "00-node.yaml").write_text("version: 1\nnode: {name: relay}\n")
    named = [str(folder / name) for name in ("00-node.yaml", "10-rear.yaml", "20-front.yml")]
    for path in ("conf", "conf/", "./conf"):
        assert load(path, environ=environ) == load(*named, environ=environ)
    (folder / "20-front.yml").rename("front.yaml")
    assert [each.name for each in load("front.yaml", "conf", environ=environ).groups] == ["front", "rear"]


def test_what_is_no_yaml_file_of_the_directory_itself_is_not_read(folder, environ):
    (folder / "front.yaml").write_text(FRONT)
    for name in (".hidden.yaml", "notes.txt", "old.yaml~", "yaml"):
        (folder / name).write_text("no file of ours")
    (folder / "below.yaml").mkdir()
    (folder / "below.yaml" / "rear.yaml").write_text(REAR)
    assert [each.name for each in load("conf", environ=environ).groups] == ["front"]


def test_files_that_are_mounted_by_links_are_read_once(folder, environ):
    # As Kubernetes mounts a ConfigMap.
    (folder / "..2026").mkdir()
    (folder / "..2026" / "front.yaml").write_text(FRONT)
    (folder / "..data").symlink_to("..2026")
    (folder / "front.yaml").symlink_to("..data/front.yaml")
    assert yaml_files("conf") == ("conf/front.yaml",)
    assert [each.name for each in load("conf", environ=environ).groups] == ["front"]


def test_a_directory_of_very_many_files_is_not_read(folder, environ):
    for number in range(MOST_FILES + 1):
        (folder / f"{number}.yaml").touch()
    assert errors(environ, "conf") == [f"conf: more than {MOST_FILES} YAML files: is this the right directory?"]


@pytest.mark.skipif(os.geteuid() == 0, reason="root reads what nobody may")
def test_a_directory_that_nobody_may_read_is_refused(folder, environ):
    folder.chmod(0)
    assert errors(environ, "conf") == ["conf: cannot be read: Permission denied"]
    folder.chmod(0o700)
