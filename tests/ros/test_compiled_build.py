"""The compiled path is built wherever it can be, and of the source that is here."""

import shutil
import sysconfig
from importlib import import_module
from pathlib import Path

import pytest

from syncrelay.ros.compiled import source_fingerprint

_COMPILER = str(sysconfig.get_config_var("CC")).split()[0]
_HEADERS = Path(sysconfig.get_path("include")) / "Python.h"


@pytest.mark.skipif(
    shutil.which(_COMPILER) is None or not _HEADERS.exists(),
    reason=f"the compiled path cannot be built here: it takes {_COMPILER} and {_HEADERS}",
)
def test_the_compiled_path_is_built_of_the_source_beside_it():
    path = import_module("syncrelay.ros.compiled.path")
    assert source_fingerprint() == path.SOURCE, "path.pyx has changed since: make test, or pip install -e ."
