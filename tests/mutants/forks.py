"""Runs pytest in processes forked from one that has imported all that no mutant of a room changes.

Run with a room and its tests, it is that process: each line of its stdin holds the words and the
limits of a run, each line of its stdout how that ended. What a room's modules need, and what needs none of them, is
imported once; the rest in each fork.
"""

import ast
import contextlib
import gc
import importlib
import json
import os
import resource
import select
import signal
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Final, NamedTuple

_PYTEST: Final = ("-q", "-x", "-p", "no:cacheprovider", "-p", "no:xdist", "--no-header", "--tb=no")
# Plugins are imported before pytest can rewrite their assertions.
_QUIET: Final = ("-W", "ignore::pytest.PytestAssertRewriteWarning")
# They start threads, and a process with threads is not to be forked.
_WITH_THREADS: Final = ("rclpy", "pyarrow", "ray")


class Ended(NamedTuple):
    """How a run ended: with this exit code, None where it hung; and what it printed."""

    code: int | None
    output: str


class Forks:
    """Runs tests in a tree; one run at a time."""

    def __init__(self, tree: Path, room: str, tests: Sequence[str], environ: Mapping[str, str]) -> None:
        self._server = subprocess.Popen(
            (sys.executable, "-P", __file__, room, *tests),
            cwd=tree,
            # Otherwise numpy starts a thread for each core.
            env={**os.environ, "PYTHONPATH": str(tree), "OPENBLAS_NUM_THREADS": "1", **environ},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def run(self, words: Sequence[str], *, cpu_s: float, wall_s: float) -> Ended:
        """Run pytest with these words; it hangs where it takes more."""
        assert self._server.stdin is not None
        assert self._server.stdout is not None
        self._server.stdin.write(json.dumps([words, cpu_s, wall_s]) + "\n")
        self._server.stdin.flush()
        return Ended(*json.loads(self._server.stdout.readline()))

    def close(self) -> None:
        """End it."""
        self._server.communicate()


def main() -> None:
    room, *tests = sys.argv[1:]
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    warnings.simplefilter("ignore")
    _import(room, tests)
    gc.collect()
    gc.freeze()
    for line in sys.stdin:
        words, cpu_s, wall_s = json.loads(line)
        answers.write(json.dumps(_forked(words, cpu_s, wall_s)) + "\n")
        answers.flush()


def _forked(words: Sequence[str], cpu_s: float, wall_s: float) -> Ended:
    with tempfile.TemporaryFile("w+") as output:
        pid = os.fork()
        if not pid:
            _run(words, output.fileno(), round(cpu_s))
        process = os.pidfd_open(pid)
        try:
            in_time = select.select([process], [], [], wall_s)[0]
        finally:
            os.close(process)
        # What it has started, too.
        with contextlib.suppress(ProcessLookupError):
            os.killpg(pid, signal.SIGKILL)
        code = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
        output.seek(0)
        return Ended(None if not in_time or code == -signal.SIGKILL else code, output.read())


def _run(words: Sequence[str], output: int, cpu_s: int) -> None:
    code = 1
    try:
        os.setpgid(0, 0)
        os.dup2(output, 1)
        os.dup2(output, 2)
        resource.setrlimit(resource.RLIMIT_CPU, (cpu_s, cpu_s))
        warnings.resetwarnings()
        code = importlib.import_module("pytest").main([*_PYTEST, *_QUIET, *words])
        sys.stdout.flush()
    finally:
        os._exit(code)


def _import(room: str, tests: Sequence[str]) -> None:
    """Import what the room's tests need and no mutant changes."""
    needs = {name: _imports(path) | _around(name) for name, path in _modules(Path("syncrelay"))}
    inside = f"syncrelay.{room.replace('/', '.')}"
    left = {name for name in needs if f"{name}.".startswith(f"{inside}.")}
    changed = set(left)
    left |= {name for name, needed in needs.items() if needed & {*_WITH_THREADS}}
    while more := {name for name, needed in needs.items() if needed & left} - left:
        left |= more
    own = [path for name, path in _modules(Path("syncrelay")) if name.startswith(inside)]
    near = [path for each in tests for path in Path(each).rglob("*.py")]
    foreign = {each for path in (*own, *near) for each in _imports(path) if _is_foreign(each)}
    near_own = {each for path in near for each in _imports(path)}
    for name in ("pytest", *sorted(foreign), *sorted((needs.keys() & near_own) - left)):
        # Names in modules are among them, and what is not installed here.
        with contextlib.suppress(ImportError):
            importlib.import_module(name)
    for name in changed & sys.modules.keys():
        raise SystemExit(f"{name} is imported, and a mutant may change it")
    if len(list(Path("/proc/self/task").iterdir())) > 1:
        raise SystemExit("something that was imported has started a thread")


def _is_foreign(name: str) -> bool:
    top = name.partition(".")[0]
    return top not in _WITH_THREADS and not Path(top).exists()


def _modules(folder: Path) -> Iterator[tuple[str, Path]]:
    for path in folder.rglob("*.py"):
        parts = path.with_suffix("").parts
        yield ".".join(parts[:-1] if parts[-1] == "__init__" else parts), path


def _imports(path: Path) -> set[str]:
    """Return all that a module imports, with the packages around it; names of what it takes from them, too."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found.update(each.name for each in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            found.update((node.module, *(f"{node.module}.{each.name}" for each in node.names)))
    return found.union(*map(_around, found))


def _around(name: str) -> set[str]:
    """Return the packages that a module is in."""
    parts = name.split(".")
    return {".".join(parts[:count]) for count in range(1, len(parts))}


if __name__ == "__main__":
    main()
