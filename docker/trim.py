"""Takes out of the image's Python environment what a running relay never opens. Run by that environment's Python.

Left out: pip and setuptools, headers, static libraries, CMake files, type stubs and numpy's tests. Libraries that the
wheels hold several times over (links flattened into files, one OpenSSL in each of eight packages) are kept once.
"""

import hashlib
import os
import shutil
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path

_FOLDERS = ("include", "lib/cmake", "share/*/cmake", "lib/python3*/site-packages/numpy/**/tests")
_FILES = ("**/*.a", "**/*.pyi", "bin/[Aa]ctivate*", "bin/pip*")
_INSTALLERS = ("pip", "setuptools", "pkg_resources", "_distutils_hack", "distutils-precedence.pth")


def main() -> None:
    root = Path(sys.prefix)
    for pattern in _FOLDERS:
        for folder in list(root.glob(pattern)):
            shutil.rmtree(folder)
    for pattern in _FILES:
        for file in root.glob(pattern):
            file.unlink()
    for packages in root.glob("lib/python3*/site-packages"):
        for path in _distributions(packages, _INSTALLERS):
            shutil.rmtree(path) if path.is_dir() else path.unlink()
    _keep_once(root.glob("lib/**/*.so*"))


def _distributions(packages: Path, names: Iterable[str]) -> Iterator[Path]:
    for name in names:
        yield from packages.glob(name)
        yield from packages.glob(f"{name}-*.dist-info")


def _keep_once(libraries: Iterator[Path]) -> None:
    """Turn equal files into links to the first of them."""
    first: dict[bytes, Path] = {}
    for library in sorted(libraries):
        if library.is_symlink():
            continue
        kept = first.setdefault(hashlib.sha256(library.read_bytes()).digest(), library)
        if kept is not library:
            library.unlink()
            library.symlink_to(os.path.relpath(kept, library.parent))


if __name__ == "__main__":
    main()
