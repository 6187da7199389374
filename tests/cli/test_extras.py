"""What `pip install syncrelay` alone gives: every command runs, or says at once which extra to install.

In `make test` a process hides what no base dependency brings; `make test-bare` runs this in a venv that lacks it.
"""

import importlib.metadata
import json
import os
import re
import subprocess
import sys
import tomllib

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from syncrelay.cli.boundary import guarded
from syncrelay.cli.commands import COMMANDS, EXTRAS
from tests.cli.command import GOOD, ROOT, example

_PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
_BARE = os.environ.get("SYNCRELAY_BARE")
# Hides all packages but the named ones where some are named, runs commands, and prints as JSON how each went: its code,
# what it printed, and which slow packages were imported by its end.
_RUNS = """
import json, sys
from contextlib import redirect_stderr, redirect_stdout
from importlib.machinery import PathFinder
given = set(filter(None, sys.argv[1].split(",")))
class Hiding:
    @staticmethod
    def find_spec(name, path=None, target=None):
        is_given = name.partition(".")[0] in given or name.startswith("_sysconfigdata")
        return PathFinder.find_spec(name, path, target) if is_given else None
if given:
    sys.meta_path[sys.meta_path.index(PathFinder)] = Hiding
from syncrelay.cli import main
slow, told = ("pydantic", "yaml", "numpy", "asyncio", "rclpy"), []
for words in json.loads(sys.argv[2]):
    with open("out", "w") as out, open("talk", "w") as talk, redirect_stdout(out), redirect_stderr(talk):
        code = main(words)
    told.append((code, open("out").read(), open("talk").read(), [each for each in slow if each in sys.modules]))
print(json.dumps(told))
"""


def _distributions(asked: list[Requirement]) -> set[str]:
    """The distributions that pip would install for these."""
    found: set[str] = set()
    waiting = list(asked)
    while waiting:
        name = canonicalize_name(waiting.pop().name)
        if name not in found:
            found.add(name)
            needed = map(Requirement, importlib.metadata.requires(name) or ())
            waiting += [each for each in needed if each.marker is None or each.marker.evaluate({"extra": ""})]
    return found


def _modules(distributions: set[str]) -> set[str]:
    of_each = importlib.metadata.packages_distributions()
    return {name for name, those in of_each.items() if distributions & set(map(canonicalize_name, those))}


def _run(commands, folder):
    """How each of these commands went, by its words."""
    for file in ("fusion.yaml", "wider.yaml"):
        (folder / file).write_text(GOOD)
    if _BARE is None:
        base = _modules(_distributions([Requirement(each) for each in _PROJECT["dependencies"]]))
        given = ",".join(sorted({*base, *sys.stdlib_module_names, "syncrelay"}))
        argv, environ = [sys.executable, "-c"], {**os.environ, "PYTHONPATH": str(ROOT)}
    else:
        given, argv, environ = "", [_BARE, "-I", "-c"], dict(os.environ)
    argv += [_RUNS, given, json.dumps(commands)]
    done = subprocess.run(argv, cwd=folder, env=environ, capture_output=True, text=True, check=False, timeout=120)
    assert done.returncode == 0, done.stderr
    return dict(zip(map(tuple, commands), json.loads(done.stdout), strict=True))


_TOLD = re.compile(r"pip install 'syncrelay\[([a-z,]+)\]'")
_WORDS = [
    *([name, *example(name)] for name in COMMANDS),
    *map(
        str.split,
        (
            "demo --record rig.mcap",
            "schema --test",
            "top --once",
            "fleet analyze drive.mcap --into sets --engine ray",
            "export drive.mcap --config fusion.yaml -o sets --format mcap",
        ),
    ),
]


def _missing(name: str, *words: str) -> list[str]:
    """The extras that a command needs for these words."""
    command = COMMANDS[name]
    arguments = command.parser().read(words)
    return [each.extra for each in command.needs if each.applies(arguments)]


def test_a_command_whose_extra_is_missing_says_what_to_type_before_anything_slow_is_imported(tmp_path):
    for words, (code, printed, told, slow) in _run([each for each in _WORDS if _missing(*each)], tmp_path).items():
        assert (code, printed) == (69, ""), (words, told)
        assert told.startswith(f"syncrelay: {words[0]} needs Python packages that are not installed: ")
        assert _TOLD.findall(told) == [",".join(_missing(*words))]
        assert slow == [], words


@pytest.mark.parametrize(("package", "extra"), [("mcap", "[recordings]"), ("pydantic", "")])
def test_a_package_that_is_too_old_is_told_with_what_to_type(package, extra, capsys):
    def command():
        raise ImportError(f"cannot import name 'new' from '{package}'", name=package)

    assert guarded(command) == 69
    said = f"  pip install 'syncrelay{extra}'     (in a clone: pip install '.{extra}')\n"
    assert said in capsys.readouterr().err


_OTHERS = [each for each in _WORDS if not _missing(*each) and each[0] != "demo"]
# No relay of this machine is meant.
_ASK = ("tap", "reload", "top")


def test_every_other_command_runs_on_what_the_base_installation_brings(tmp_path):
    commands = [[*each, "--url", "localhost:1"] if each[0] in _ASK else each for each in _OTHERS]
    for words, (code, _, told, _) in _run([*commands, ["demo", "--show-config"]], tmp_path).items():
        assert code in {0, 1}, (words, told)
        assert "Traceback" not in told
        assert "lacks a Python package" not in told


def test_the_relay_and_the_demo_lack_nothing_but_ros(tmp_path):
    for words, (code, printed, told, _) in _run([["--config", "fusion.yaml"], ["demo"]], tmp_path).items():
        assert (code, printed) == (69, ""), words
        assert "rclpy" in told


@pytest.mark.parametrize("extra", EXTRAS)
def test_the_packages_of_an_extra_are_those_that_pyproject_names(extra):
    asked = [Requirement(each) for each in _PROJECT["optional-dependencies"][extra]]
    own = [each for each in asked if each.name != "syncrelay"]
    known = importlib.metadata.packages_distributions()
    named = {canonicalize_name(each) for module in EXTRAS[extra] for each in known.get(module.partition(".")[0], ())}
    installed = {canonicalize_name(each.name) for each in own if _is_installed(each.name)}
    assert named <= {canonicalize_name(each.name) for each in own} | {"ruamel-yaml", "ruamel-yaml-clib"}
    # What only reads object storage is asked for where a URL needs it.
    assert installed - named <= {"aiohttp", "fsspec", "gcsfs", "s3fs"}


def _is_installed(name: str) -> bool:
    try:
        importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return False
    return True


def test_the_reference_says_which_command_needs_which_extra():
    page = (ROOT / "docs" / "reference" / "command_line.md").read_text()
    for name, command in COMMANDS.items():
        section = page.partition(f"\n## syncrelay {name}\n")[2].partition("\n## ")[0]
        assert re.findall(r"#extras\) `(\w+)`", section) == [each.extra for each in command.needs], name
    assert set(EXTRAS) == {each.extra for command in COMMANDS.values() for each in command.needs}
