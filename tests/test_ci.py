"""`make` and CI need no settings of the machine, and install pinned versions."""

import itertools
import subprocess
import sys
import tomllib
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

_ROOT = Path(__file__).parents[1]


def test_a_python_is_found_where_not_even_home_is_set(tmp_path):
    (tmp_path / "python3.12").symlink_to(sys.executable)
    found = subprocess.run(
        ["/bin/sh", str(_ROOT / ".ci" / "python"), "--all"],
        env={"PATH": str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (found.returncode, found.stderr) == (0, "")
    assert len(found.stdout.splitlines()) == 1


def test_every_dependency_is_pinned_to_a_version_that_is_allowed_and_to_no_host():
    project = tomllib.loads((_ROOT / "pyproject.toml").read_text())["project"]
    names = ("recordings", "datasets", "top", "test", "docs", "lint")
    extras = [project["optional-dependencies"][name] for name in names]
    asked = [Requirement(each) for each in itertools.chain(project["dependencies"], *extras)]
    asked = [each for each in asked if each.name != project["name"]]
    lines = [line for line in (_ROOT / ".ci/constraints.txt").read_text().splitlines() if not line.startswith("#")]
    pinned = {canonicalize_name(name): version for name, _, version in (line.partition("==") for line in lines)}
    assert {canonicalize_name(each.name) for each in asked} == set(pinned)
    assert [str(each) for each in asked if not each.specifier.contains(pinned[canonicalize_name(each.name)])] == []
