"""Tasks of the tests, which do to a recording what its first line asks for."""

import os
import signal
import time
from dataclasses import dataclass
from errno import ENOSPC
from pathlib import Path

from syncrelay.errors import BagError
from syncrelay.recordings.fleet.task import Source, fingerprint_of

OBEDIENT = """
import sys
from argparse import Namespace
from syncrelay.cli.boundary import guarded
from syncrelay.cli.many import do_on_many
from syncrelay.cli.stop import Termination
from tests.recordings.fleet.tasks import Obedient
options = Namespace(into="out", engine=sys.argv[1], jobs=2, strict=False, overwrite=False, time_limit=None)
with Termination():
    sys.exit(guarded(lambda: do_on_many(Obedient(), sys.argv[2:], options)))
"""
"""A program that has an engine do the task on recordings."""


@dataclass(frozen=True, slots=True)
class Obedient:
    """Copies a recording; or does what its first line says. Each attempt is a line in a file beside it."""

    option: int = 0

    @property
    def fingerprint(self) -> str:
        return fingerprint_of("copy", config="", options={"option": self.option})

    def run(self, source: Source, folder: Path):
        path = Path(source.place)
        with path.with_suffix(".attempts").open("a") as attempts:
            attempts.write(f"{os.getpid()}\n")
        text = path.read_text()
        match text.partition("\n")[0].split():
            case ["die", times] if attempts_of(path) <= int(times):
                (folder / "half").write_text("ha")
                os.kill(os.getpid(), signal.SIGKILL)
            case ["refuse"]:
                raise BagError(f"{path.name}: is of no use")
            case ["break"]:
                raise ZeroDivisionError
            case ["fill"]:
                raise OSError(ENOSPC, os.strerror(ENOSPC))
            case ["hang"]:
                (folder / "half").write_text("ha")
                while True:
                    time.sleep(1)
            case ["take", size]:
                bytearray(int(size))
            case ["grow"]:
                path.write_text(f"{text} more")
        (folder / "below").mkdir()
        (folder / "below" / "copy").write_text(text)
        return {"letters": len(text)}


def attempts_of(path: Path) -> int:
    """How often a recording was begun."""
    attempts = path.with_suffix(".attempts")
    return len(attempts.read_text().splitlines()) if attempts.exists() else 0
