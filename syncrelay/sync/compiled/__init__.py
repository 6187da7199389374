"""Extension modules, built where there is a C compiler when syncrelay is installed; all works without them.

Here is the one for messages in columns, and what it shares with the one of `ros`: lent.pxi and searched.pxi.
"""

import hashlib
from pathlib import Path
from typing import Final

_SUFFIXES: Final = (".pxi", ".pyx")


def source_fingerprint() -> str | None:
    """What `SOURCE` of all of them is if they were built from the source in this folder and that of `ros`.

    None where no source is installed.
    """
    sources = sorted(each for each in Path(__file__).parents[2].glob("*/compiled/*.p*") if each.suffix in _SUFFIXES)
    return hashlib.sha256(b"".join(each.read_bytes() for each in sources)).hexdigest() if sources else None
