"""A release sets one version everywhere; a faulty one is refused before anything is built."""

import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

_ROOT = Path(__file__).parents[1]
_PYPROJECT = tomllib.loads((_ROOT / "pyproject.toml").read_text())
_VERSION = _PYPROJECT["project"]["version"]
_PLACES = _PYPROJECT["tool"]["bumpversion"]["files"]
_SECTION = "## [9.8.7] - 2026-12-31"
_PROGRAM = shutil.which("git") or "git"
# The user's own settings, such as signed commits, are not used.
_GIT = {
    **{name: value for name, value in os.environ.items() if not name.startswith("GIT_")},
    "GIT_CONFIG_GLOBAL": os.devnull,
    **{f"GIT_{role}_{what}": "a@example.org" for role in ("AUTHOR", "COMMITTER") for what in ("NAME", "EMAIL")},
}


def _git(clone: Path, *words: str) -> str:
    return subprocess.run([_PROGRAM, *words], cwd=clone, env=_GIT, check=True, capture_output=True, text=True).stdout


def _release(clone: Path, version: str, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [clone / ".ci" / "release", sys.executable, version],
        env=_GIT | environment,
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.parametrize("place", _PLACES, ids=lambda place: place.get("filename", place.get("glob")))
def test_every_place_of_the_version_that_a_release_sets_has_the_version_of_the_package(place):
    files = list(_ROOT.glob(place.get("filename", place.get("glob"))))
    assert files
    for file in files:
        assert file.read_text().count(place["search"].format(current_version=_VERSION)) == 1, file
    assert place["replace"] == place["search"].replace("current", "new")


def test_the_changelog_has_an_unreleased_section_and_then_the_versions_newest_first():
    headings = re.findall(r"^## (.*)$", (_ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)
    assert headings[0] == "Unreleased"
    versions = [re.fullmatch(r"\[(\d+)\.(\d+)\.(\d+)\] - \d{4}-\d\d-\d\d", heading) for heading in headings[1:]]
    assert all(versions), headings
    numbers = [tuple(map(int, version.groups())) for version in versions if version]
    assert numbers == sorted(numbers, reverse=True)
    assert ".".join(map(str, numbers[0])) == _VERSION


@pytest.fixture
def small_clone(tmp_path: Path) -> Path:
    """A repository with the files that .ci/release checks before it builds."""
    clone = tmp_path / "clone"
    (clone / ".ci").mkdir(parents=True)
    shutil.copy(_ROOT / ".ci" / "release", clone / ".ci")
    (clone / "CHANGELOG.md").write_text(f"# Changelog\n\n## Unreleased\n\n{_SECTION}\n")
    _git(tmp_path, "init", "--quiet", str(clone))
    _git(clone, "add", ".")
    _git(clone, "commit", "--quiet", "--message", "Begin")
    return clone


def test_a_release_is_refused_with_changes_that_are_not_committed(small_clone):
    (small_clone / "CHANGELOG.md").write_text(f"{_SECTION}\n")
    run = _release(small_clone, "9.8.7")
    assert (run.returncode, run.stderr) == (1, "no release: there are changes that are not committed\n")


def test_a_release_is_refused_whose_tag_is_there(small_clone):
    _git(small_clone, "tag", "v9.8.7")
    run = _release(small_clone, "9.8.7")
    assert (run.returncode, run.stderr) == (1, "no release: the tag v9.8.7 is there already\n")


@pytest.mark.parametrize("version", ["9.8.70", "9.8", "19.8.7", "9x8.7", "v9.8.7", ""])
def test_a_release_is_refused_that_is_no_version_or_not_in_the_changelog(small_clone, version):
    run = _release(small_clone, version)
    assert run.returncode == 1
    is_version = re.fullmatch(r"\d+\.\d+\.\d+", version)
    assert (f"CHANGELOG.md has no section '## [{version}]" if is_version else "is no version") in run.stderr


@pytest.mark.release
@pytest.mark.timeout(1800)
@pytest.mark.skipif("SYNCRELAY_RELEASE" not in os.environ, reason="it installs much: `make test-release` runs it")
def test_a_release_is_a_commit_and_a_tag_of_what_was_built_and_tried(tmp_path):
    origin, clone = tmp_path / "origin", tmp_path / "clone"
    _git(tmp_path, "clone", "--quiet", "--bare", str(_ROOT), str(origin))
    _git(origin, "branch", "--force", "released", _git(_ROOT, "rev-parse", "HEAD").strip())
    _git(tmp_path, "clone", "--quiet", "--branch", "released", str(origin), str(clone))
    changelog = clone / "CHANGELOG.md"
    changelog.write_text(changelog.read_text().replace("## Unreleased\n", f"## Unreleased\n\n{_SECTION}\n", 1))
    _git(clone, "commit", "--quiet", "--all", "--message", "Name what the version brings")
    before = _state(clone)

    _shown_release(clone, DRY="1")
    assert _state(clone) == before
    assert _git(clone, "status", "--porcelain", "--ignored") == ""

    _shown_release(clone)
    assert _git(clone, "rev-parse", "HEAD") == _git(clone, "rev-parse", "v9.8.7^{commit}")
    assert _git(clone, "log", "-1", "--format=%s") == "Release 9.8.7\n"
    assert _git(clone, "status", "--porcelain") == ""
    assert _git(clone, "diff", "--name-only", "HEAD~").split() == [
        "CITATION.cff",
        "docker/Dockerfile",
        "docker/Dockerfile.ros",
        "package.xml",
        "pyproject.toml",
    ]
    assert sorted(path.suffix for path in (clone / "dist").iterdir()) == [".gz", ".whl"]
    assert all(path.name.startswith("syncrelay-9.8.7") for path in (clone / "dist").iterdir())
    assert _git(origin, "for-each-ref", "refs/tags/v9.8.7") == ""


def _state(clone: Path) -> str:
    return _git(clone, "for-each-ref") + _git(clone, "rev-parse", "HEAD")


def _shown_release(clone: Path, **environment: str) -> None:
    """Make a release; its output is not captured, so that `make test-release` shows it."""
    subprocess.run([clone / ".ci" / "release", sys.executable, "9.8.7"], env=_GIT | environment, check=True)
