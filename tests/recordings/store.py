"""A store that fsspec knows as store://: a folder, as if it were far away. It may refuse files, or be full."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from unittest.mock import patch

import pytest

from syncrelay import urls

fsspec = pytest.importorskip("fsspec", reason="the extra `fleet` is not installed")
local = pytest.importorskip("fsspec.implementations.local")


class _Store(local.LocalFileSystem):  # type: ignore[name-defined]
    """As a bucket: it has no folders of its own, and `wrong` files are refused so often; it is full where negative."""

    protocol = "store"
    cachable = False
    root = ""
    wrong = 0

    @classmethod
    def _strip_protocol(cls, path):
        path = str(path).removeprefix("store://").rstrip("/")
        return path if path.startswith(cls.root) else f"{cls.root}/{path}".rstrip("/")

    def unstrip_protocol(self, name):
        return "store://" + self._strip_protocol(name)[len(self.root) + 1 :]

    def put_file(self, source, target, **_options):
        if _Store.wrong < 0:
            raise OSError(28, "No space left on device")
        if _Store.wrong and not target.endswith("_ledger.jsonl"):
            _Store.wrong -= 1
            raise ConnectionResetError(104, "Connection reset by peer")
        shutil.copy(source, target)


@contextmanager
def known_store(folder: Path, wrong: int) -> Iterator[None]:
    """Have store:// be a folder that refuses the first files, or all where `wrong` is negative."""
    fsspec.register_implementation("store", _Store, clobber=True)
    with (
        patch.object(_Store, "root", str(folder)),
        patch.object(_Store, "wrong", wrong),
        patch.object(urls, "_FIRST_WAIT", 0.01),
    ):
        yield
