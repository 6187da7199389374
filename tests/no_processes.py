"""`pytest -p tests.no_processes` fails tests that start a process or import rclpy, to keep `make test-fast` fast."""

import sys
from collections.abc import Iterator

import pytest

# The audit events that CPython raises before it starts a process: https://docs.python.org/3/library/audit_events.html.
_STARTS = ("os.fork", "os.forkpty", "os.posix_spawn", "os.system", "subprocess.Popen")


class _NoProcesses:
    def __init__(self) -> None:
        self._runs = False
        sys.addaudithook(self._hear)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self) -> Iterator[None]:
        self._runs = True
        try:
            return (yield)
        finally:
            self._runs = False

    def _hear(self, event: str, arguments: tuple) -> None:
        if self._runs and (event in _STARTS or (event == "import" and arguments[0] == "rclpy")):
            what = " ".join(map(str, (event, *arguments[:1])))
            pytest.fail(f"{what}: no test of `make test-fast`; give it a marker that leaves it out")


def pytest_configure(config: pytest.Config) -> None:
    config.pluginmanager.register(_NoProcesses())
