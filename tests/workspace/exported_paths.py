"""Has the CMake files of ROS's wheels name this venv's headers, and not those of the machine that built the wheels.

Run by the Python of the venv whose packages are to be mended.
"""

import re
import sys
import sysconfig
from pathlib import Path

import numpy as np

_BUILDER = r"/opt/python/cp\d+-cp\d+"
_THERE = {
    rf"{_BUILDER}/include/python3\.\d+": sysconfig.get_path("include"),
    rf"{_BUILDER}/lib/python3\.\d+/site-packages/numpy/_core/include": np.get_include(),
}

for file in (Path(sys.prefix) / "share").glob("*/cmake/*.cmake"):
    before = after = file.read_text()
    for pattern, path in _THERE.items():
        after = re.sub(pattern, path, after)
    if after != before:
        file.write_text(after)
