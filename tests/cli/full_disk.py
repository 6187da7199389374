"""Commands on disks of every size, in a process with mounts of its own: prints as JSON how each try went.

`python -m tests.cli.full_disk SEED SIZES FOLDER` mounts the disk below FOLDER, which holds the files that the commands
name.
"""

import json
import os
import random
import shutil
import subprocess
import sys
from collections.abc import Mapping
from hashlib import blake2b
from pathlib import Path
from typing import Any

from tests.cli.command import run_here

_PAGE = 4096
_RIG = ("../rig.mcap", "--config", "../fusion.yaml")
COMMANDS: Mapping[str, tuple[str, ...]] = {
    "replay -o FILE": ("replay", *_RIG, "-o", "sets.mcap"),
    "replay -o FOLDER": ("replay", *_RIG, "-o", "below/sets"),
    "fleet replay": ("fleet", "replay", *_RIG, "--into", "many", "--jobs", "1"),
    "demo --record": ("demo", "--record", "demo.mcap", "--seconds", "1"),
    "analyze --html": ("analyze", *_RIG, "--html", "report.html"),
    "analyze --write": ("analyze", *_RIG, "--write", "better.yaml"),
    "fleet analyze": ("fleet", "analyze", *_RIG, "--into", "many", "--jobs", "1"),
    "init": ("init", "--from-bag", "../rig.mcap", "-o", "new.yaml"),
    "export": ("export", *_RIG, "-o", "dataset", "--jobs", "1"),
    "export --format mcap": ("export", *_RIG, "-o", "dataset", "--jobs", "1", "--format", "mcap"),
    "export --format lerobot": (
        *("export", "../drive.mcap", "--config", "../lerobot.yaml", "-o", "dataset", "--jobs", "1"),
        *("--format", "lerobot"),
    ),
}


class Disk:
    """A tmpfs; `None` for as many bytes as there are."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        folder.mkdir()
        self._mount("-t", "tmpfs")

    def begin(self, size: int | None) -> None:
        """Take away what is there, and leave room for so many bytes beside a page: a size of 0 would be no limit."""
        self.resize(None)
        for path in self.folder.iterdir():
            shutil.rmtree(path) if path.is_dir() else path.unlink()
        (self.folder / "page").write_text("held")
        self.resize(size)

    def resize(self, size: int | None) -> None:
        # No tmpfs is smaller than what it holds.
        self._mount("-o", f"remount,size={(1 << 30) if size is None else self.used() + size}")

    def used(self) -> int:
        there = os.statvfs(self.folder)
        return (there.f_blocks - there.f_bfree) * there.f_frsize

    def content(self) -> dict[str, str]:
        """What a user sees there: hidden files and the ledger's lines, which hold no result, are left out."""
        files = [path for path in self.folder.rglob("*") if path.is_file() and "ledger" not in path.name]
        return {
            str(path.relative_to(self.folder)): blake2b(path.read_bytes()).hexdigest()
            for path in files
            if not any(part.startswith(".") for part in path.relative_to(self.folder).parts)
        }

    def _mount(self, *options: str) -> None:
        subprocess.run(["mount", *options, "disk", self.folder], check=True)  # noqa: S607


def tries(folder: Path, sizes: int, seed: str) -> dict[str, Any]:
    """Try each command with room for all, then with random sizes below what it takes, each twice."""
    disk, chance = Disk(folder / "disk"), random.Random(seed)
    told: dict[str, Any] = {}
    for name, words in COMMANDS.items():
        disk.begin(None)
        done = run_here(*words, folder=disk.folder)
        whole, used = disk.content(), disk.used()
        rows = []
        for _ in range(sizes):
            # One page is held.
            size = chance.randrange(max(1, used // _PAGE - 1)) * _PAGE
            disk.begin(size)
            full = run_here(*words, folder=disk.folder)
            left = disk.content()
            disk.resize(None)
            again = run_here(*words, folder=disk.folder)
            rows.append(
                {
                    "size": size,
                    "code": full.returncode,
                    "stderr": full.stderr,
                    "broken": sorted(dict(left.items() - whole.items())),
                    "again": [again.returncode, again.stderr],
                    "same": disk.content() == whole,
                }
            )
        told[name] = {"code": done.returncode, "stderr": done.stderr, "used": used, "tries": rows}
    return told


if __name__ == "__main__":
    sys.stdout.write(json.dumps(tries(Path(sys.argv[3]), int(sys.argv[2]), sys.argv[1])))
