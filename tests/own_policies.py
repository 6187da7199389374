"""Packages that bring policies: examples/led-by, and broken ones."""

import shutil
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from unittest.mock import patch

from syncrelay.config.installed import installed_policies

_EXAMPLE = Path(__file__).parents[1] / "examples" / "led-by"


def installed_example(folder: Path) -> Path:
    """Build and install the example, and return the folder to put on sys.path."""
    source, target = folder / "led-by", folder / "target"
    shutil.copytree(_EXAMPLE, source)
    pip = [sys.executable, "-m", "pip", "install", "--no-index", "--no-deps", "--no-build-isolation"]
    done = subprocess.run([*pip, "--target", target, source], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return target


def offer(folder: Path, distribution: str, policies: Mapping[str, str], *, text: str = "") -> None:
    """Write an installed distribution into a folder: a module with this text, and the entry points of its policies."""
    module = distribution.replace("-", "_")
    (folder / f"{module}.py").write_text(text)
    told = folder / f"{module}-1.0.dist-info"
    told.mkdir()
    (told / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {distribution}\nVersion: 1.0\n")
    entries = "".join(f"{name} = {module}:{of}\n" for name, of in policies.items())
    (told / "entry_points.txt").write_text(f"[syncrelay.policies]\n{entries}")


@contextmanager
def on_path(folder: Path) -> Iterator[None]:
    """Make what is installed in a folder importable in this process."""
    before = set(sys.modules)
    with patch.object(sys, "path", [str(folder), *sys.path]):
        installed_policies.cache_clear()
        try:
            yield
        finally:
            for name in set(sys.modules) - before:
                if str(getattr(sys.modules[name], "__file__", "")).startswith(str(folder)):
                    del sys.modules[name]
            installed_policies.cache_clear()
