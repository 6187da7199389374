"""What is no plain file: it is read to its end, or said to have none in time."""

import os
import socket
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from syncrelay.config import ConfigError, load
from syncrelay.config.source import Source, read_source
from tests.cli.command import GOOD

_NO_END = "could not be read to its end within 0.2 s: is it a pipe that nobody writes to, or closes?"


@contextmanager
def beside(act: Callable[[], None]) -> Iterator[None]:
    """Do something on a thread of its own, and see it done."""
    thread = threading.Thread(target=act)
    thread.start()
    try:
        yield
    finally:
        thread.join()


@pytest.fixture
def fifo(tmp_path: Path) -> Path:
    os.mkfifo(tmp_path / "pipe.yaml")
    return tmp_path / "pipe.yaml"


def text_of(path: Path | str, *, patience_s: float = 0.2) -> str:
    with pytest.raises(ConfigError) as raised:
        load(str(path), environ={}, patience_s=patience_s)
    return str(raised.value)


def test_a_pipe_that_nobody_writes_to_is_given_up(fifo: Path):
    assert text_of(fifo) == f"{fifo}: {_NO_END}"


def test_pipes_that_are_read_together_are_waited_for_together(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """They are given up one after another, without a wait for each; what is written to others is read all the same."""
    begun: list[float] = []

    def noted(path: str, *, patience_s: float, since: float) -> Source:
        begun.append(since)
        return read_source(path, patience_s=patience_s, since=since)

    monkeypatch.setattr(sys.modules["syncrelay.config.load"], "read_source", noted)
    for number in range(20):
        os.mkfifo(tmp_path / f"{number:02}.yaml")
    assert text_of(tmp_path).count(_NO_END) == 20
    assert begun == [begun[0]] * 20
    read_end, written = os.pipe()
    os.write(written, b"version: 1")
    os.close(written)
    assert read_source(f"/dev/fd/{read_end}", patience_s=0.2, since=begun[0]).text == "version: 1"
    os.close(read_end)


@pytest.mark.parametrize("content", ["", GOOD])
def test_a_pipe_that_nobody_closes_is_given_up(content: str, fifo: Path):
    held = os.open(fifo, os.O_RDWR)
    os.write(held, content.encode())
    assert text_of(fifo) == f"{fifo}: {_NO_END}"
    os.close(held)


def test_a_pipe_is_read_to_its_end_in_whatever_pieces_it_comes(fifo: Path):
    def write() -> None:
        with fifo.open("wb", buffering=0) as pipe:
            for byte in GOOD.encode():
                pipe.write(bytes([byte]))

    with beside(write):
        config = load(str(fifo), environ={}, patience_s=60)
    assert [group.name for group in config.groups] == ["front"]


def test_of_a_pipe_without_end_no_more_is_read_than_a_file_may_hold(fifo: Path):
    def write() -> None:
        with suppress(BrokenPipeError), fifo.open("wb", buffering=0) as pipe:
            while True:
                pipe.write(b"# more\n" * 1000)

    with beside(write):
        assert text_of(fifo, patience_s=60) == f"{fifo}: larger than 1 MB: is this the right file?"


def test_a_socket_is_no_file(tmp_path: Path):
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind(str(tmp_path / "f.yaml"))
        assert text_of(tmp_path / "f.yaml") == f"{tmp_path}/f.yaml: is a socket, expected a YAML file"


@pytest.mark.parametrize("device", ["/dev/zero", "/dev/null", "/dev/tty", "/dev/full"])
def test_a_device_is_not_even_opened(device: str):
    assert text_of(device) == f"{device}: is a device, expected a YAML file"
