"""Skips tests for which this machine lacks something, and gives each test with ROS a domain of its own."""

import gc
import importlib.metadata
import importlib.util
import itertools
import os
import signal
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

from tests.faults.extent import chosen
from tests.ros.domain import claimed_domain
from tests.ros.stage import BACKEND, Stage, running_stage

_REAL_DATA = "SYNCRELAY_REAL_DATA"
_FIGURES = "figures"


# No deadline, so that a slow machine does not fail; the same examples in every run, except in the long form.
_any = settings(deadline=None, database=None, suppress_health_check=[HealthCheck.too_slow])
settings.register_profile("long", _any, max_examples=400, print_blob=True)
settings.register_profile("short", _any, max_examples=25, derandomize=True)
# Of `make test-fast`.
settings.register_profile("quick", _any, max_examples=10, derandomize=True)


def pytest_configure(config: pytest.Config) -> None:
    settings.load_profile(config.getoption("--hypothesis-profile") or chosen(short="short", long="long"))
    # A shell that starts the tests in the background lets them, and all that they start, ignore Ctrl-C.
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    named = os.environ.get(_REAL_DATA)
    if named and not Path(named).is_dir():
        raise pytest.UsageError(f"{_REAL_DATA}={named}: no such folder")
    others = sorted(entry.value for entry in importlib.metadata.entry_points(group="syncrelay.policies"))
    if others:
        # They would appear in the schema and pages that tests compare with those in the repository.
        raise pytest.UsageError(f"policies of other packages are installed here, uninstall them: {', '.join(others)}")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Spread the modules with ROS, which wait more than they compute, among the others; tests of a minute come first.

    Workers of pytest-xdist take consecutive tests: otherwise one of them gets all tests that wait.
    """
    modules = [list(module) for _, module in itertools.groupby(items, key=lambda item: item.path)]
    placed: list[tuple[float, list[pytest.Item]]] = []
    for with_ros in (True, False):
        alike = [each for each in modules if any(item.get_closest_marker("ros") for item in each) is with_ros]
        begins = itertools.accumulate(map(len, alike), initial=0)
        whole = sum(map(len, alike))
        placed += [(begin / whole, module) for begin, module in zip(begins, alike, strict=False)]
    placed.sort(key=lambda each: each[0])
    spread = [item for _, module in placed for item in module]
    items[:] = sorted(spread, key=lambda item: item.get_closest_marker("first") is None)


def pytest_collection_finish() -> None:
    # The objects of 7,000 tests live to the end; each collection would take a third of a second to visit them.
    gc.collect()
    gc.freeze()


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    reports = [report for reports in terminalreporter.stats.values() for report in reports]
    lines = [line for report in reports for name, line in getattr(report, "user_properties", ()) if name == _FIGURES]
    if lines:
        terminalreporter.section("what it survived")
    for line in dict.fromkeys(lines):
        terminalreporter.write_line(line)


def pytest_runtest_setup(item: pytest.Item) -> None:
    if item.get_closest_marker("ros") and importlib.util.find_spec("rclpy") is None:
        pytest.skip("rclpy is not installed: pip install '.[ros]', or source a ROS 2 installation")
    if item.get_closest_marker("real_data") and not os.environ.get(_REAL_DATA):
        pytest.skip(f"{_REAL_DATA} does not name the folder of the shared recordings")


@pytest.fixture
def real_data() -> Path:
    """The folder of the shared recordings, for tests marked real_data."""
    return Path(os.environ[_REAL_DATA])


@pytest.fixture
def ros_domain() -> Iterator[int]:
    """A ROS domain id that nothing else on the machine uses."""
    with claimed_domain() as domain:
        yield domain


@pytest.fixture
def backend() -> str:
    """The backend that the relay's messages pass through; tests marked `both_backends` run on each."""
    return BACKEND


@pytest.fixture
def figures(record_property: Callable[[str, object], None]) -> Callable[[str], None]:
    """Takes a line of figures, printed after all tests."""
    return lambda line: record_property(_FIGURES, line)


@pytest.fixture
def stage(tmp_path: Path, ros_domain: int, backend: str) -> Iterator[Stage]:
    """Starts players, relays and collectors on a domain of their own, and ends them all."""
    with running_stage(tmp_path, ros_domain, backend) as opened:
        yield opened
