"""Compiled code is built wherever it can be, and of the source that is here."""

import shutil
import subprocess
import sysconfig
from importlib import import_module
from importlib.util import find_spec

import pytest

from syncrelay.sync.compiled import source_fingerprint

_COMPILER = str(sysconfig.get_config_var("CC")).split()[0]
_HEADERS = ("Python.h", "linux/futex.h")


def _can_be_built() -> bool:
    """Whether there are a compiler and the headers: Python's, and those of C's library and the kernel."""
    if shutil.which(_COMPILER) is None:
        return False
    words = [_COMPILER, "-fsyntax-only", f"-I{sysconfig.get_path('include')}", "-xc", "-"]
    text = "".join(f"#include <{header}>\n" for header in _HEADERS)
    return subprocess.run(words, input=text, text=True, capture_output=True, check=False).returncode == 0


@pytest.mark.parametrize("name", ["syncrelay.ros.compiled.path", "syncrelay.sync.compiled.columns"])
def test_compiled_code_is_built_of_the_source_beside_it(name):
    if not _can_be_built():
        pytest.skip(f"compiled code cannot be built here: it takes {_COMPILER}, {' and '.join(_HEADERS)}")
    assert find_spec(name), "it is not built, though it could be by now: pip install -e ."
    assert source_fingerprint() == import_module(name).SOURCE, (
        "its source has changed since: make test, or pip install -e ."
    )
