"""How Fast DDS carries messages: what the file asks for, set before rclpy starts."""

import logging
from collections.abc import MutableMapping
from pathlib import Path
from typing import Final

from syncrelay.config import Transport

LARGE_MESSAGES: Final = Path(__file__).with_name("large_messages.xml")
"""The profiles file for messages over the 0.5 MB of Fast DDS's default shared-memory segment."""

PROFILES: Final = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")
"""The variables that name a profiles file: Fast DDS 2 (Jazzy) reads the first, Fast DDS 3 (Kilted) the second."""

# With one of these the user has chosen already, as our image does: shared memory may not reach the others.
_CHOICES: Final = (*PROFILES, "FASTDDS_BUILTIN_TRANSPORTS")

_LOG = logging.getLogger("syncrelay")


def apply_transport(transport: Transport, environ: MutableMapping[str, str]) -> None:
    """Have the process with this environment carry messages as the file asks; what the environment says stands."""
    if transport == "default":
        return
    chosen = [f"{name}={environ[name]}" for name in _CHOICES if environ.get(name)]
    if chosen:
        _LOG.warning("`transport: %s` has no effect: the environment has %s", transport, " ".join(chosen))
        return
    environ.update(dict.fromkeys(PROFILES, str(LARGE_MESSAGES)))
