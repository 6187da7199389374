"""What `pip install syncrelay` alone gives: every command runs, or says at once which extra to install.

In `make test` a process hides what no base dependency brings; `make test-bare` runs this in a venv that lacks it.
"""

import importlib.metadata
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
# Hides all packages but the named ones, runs a command, and says at the end which slow packages were imported.
_HIDING = """
import atexit, sys
given = set(sys.argv.pop(1).split(","))
from importlib.machinery import PathFinder
class Hiding:
    @staticmethod
    def find_spec(name, path=None, target=None):
        is_given = name.partition(".")[0] in given or name.startswith("_sysconfigdata")
        return PathFinder.find_spec(name, path, target) if is_given else None
sys.meta_path[sys.meta_path.index(PathFinder)] = Hiding
slow = ("pydantic", "yaml", "numpy", "asyncio", "rclpy")
atexit.register(lambda: print("slow:", *(each for each in slow if each in sys.modules), file=sys.stderr))
from syncrelay.cli import main
sys.exit(main())
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


def _run(words, folder):
    base = _modules(_distributions([Requirement(each) for each in _PROJECT["dependencies"]]))
    if _BARE is None:
        given = ",".join(sorted({*base, *sys.stdlib_module_names, "syncrelay"}))
        argv, environ = [sys.executable, "-c", _HIDING, given, *words], {**os.environ, "PYTHONPATH": str(ROOT)}
    else:
        argv, environ = [_BARE, "-I", "-m", "syncrelay", *words], dict(os.environ)
    return subprocess.run(argv, cwd=folder, env=environ, capture_output=True, text=True, check=False, timeout=120)


_TOLD = re.compile(r"pip install 'syncrelay\[([a-z,]+)\]'")
_WORDS = [
    *([name, *example(name)] for name in COMMANDS),
    *map(
        str.split,
        (
            "demo --record rig.mcap",
            "schema --test",
            "top --once",
            "analyze drive.mcap --into sets --engine ray",
            "export drive.mcap --config fusion.yaml -o sets --format mcap",
        ),
    ),
]


def _missing(name: str, *words: str) -> list[str]:
    """The extras that a command needs for these words."""
    command = COMMANDS[name]
    arguments = command.parser().read(words)
    return [each.extra for each in command.needs if each.applies(arguments)]


@pytest.mark.parametrize("words", [each for each in _WORDS if _missing(*each)], ids=" ".join)
def test_a_command_whose_extra_is_missing_says_what_to_type_before_anything_slow_is_imported(words, tmp_path):
    done = _run(words, tmp_path)
    assert (done.returncode, done.stdout) == (69, ""), done.stderr
    assert done.stderr.startswith(f"syncrelay: {words[0]} needs Python packages that are not installed: ")
    assert _TOLD.findall(done.stderr) == [",".join(_missing(*words))]
    if _BARE is None:
        assert done.stderr.splitlines()[-1] == "slow:"


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


@pytest.mark.parametrize("words", [*_OTHERS, ["demo", "--show-config"]], ids=" ".join)
def test_every_other_command_runs_on_what_the_base_installation_brings(words, tmp_path):
    for file in ("fusion.yaml", "wider.yaml"):
        (tmp_path / file).write_text(GOOD)
    done = _run([*words, "--url", "localhost:1"] if words[0] in _ASK else words, tmp_path)
    assert done.returncode in {0, 1}, done.stderr
    assert "Traceback" not in done.stderr
    assert "lacks a Python package" not in done.stderr


@pytest.mark.parametrize("words", [["--config", "fusion.yaml"], ["demo"]])
def test_the_relay_and_the_demo_lack_nothing_but_ros(words, tmp_path):
    (tmp_path / "fusion.yaml").write_text(GOOD)
    done = _run(words, tmp_path)
    assert (done.returncode, done.stdout) == (69, "")
    assert "rclpy" in done.stderr


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
