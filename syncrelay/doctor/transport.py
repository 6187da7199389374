"""Fast DDS's own variables: how messages travel."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Final
from xml.parsers import expat

from syncrelay.config.wording import did_you_mean
from syncrelay.doctor.diagnosis import Diagnosis, error, info
from syncrelay.environment.transport import PROFILES

_VARIABLE: Final = "FASTDDS_BUILTIN_TRANSPORTS"
_TRANSPORTS: Final = ("DEFAULT", "UDPv4", "SHM", "UDPv6", "DEFAULTv6", "LARGE_DATA", "LARGE_DATAv6")
_WITH_SHARED_MEMORY: Final = ("DEFAULT", "SHM", "DEFAULTv6", "LARGE_DATA", "LARGE_DATAv6")
_EXPECTED: Final = "export FASTDDS_BUILTIN_TRANSPORTS=UDPv4    with containers or several users; otherwise unset it"


def uses_shared_memory(environ: Mapping[str, str]) -> bool:
    """Whether Fast DDS sends through /dev/shm by what the environment asks for, profiles files aside."""
    word = environ.get(_VARIABLE, "DEFAULT").partition("?")[0]
    return word in _WITH_SHARED_MEMORY or word not in _TRANSPORTS


def uses_defaults(environ: Mapping[str, str]) -> bool:
    """Whether Fast DDS carries messages as it does where nothing is said: over 0.5 MB of shared memory."""
    return environ.get(_VARIABLE, "DEFAULT") == "DEFAULT" and not any(map(environ.get, PROFILES))


def check_transport(environ: Mapping[str, str]) -> Iterator[Diagnosis]:
    """Yield values that Fast DDS refuses, and those that limit which nodes data reach."""
    for name in PROFILES:
        if environ.get(name) and (fault := _xml_fault(Path(environ[name]))):
            yield error(
                "profiles_file",
                f"{name}={environ[name]}: {fault}",
                impact="Fast DDS ignores it: QoS, transports and peers are not what the file says",
                fix=f"fix the path (in a container: mount the file), or: unset {name}",
            )
    asked = environ.get(_VARIABLE)
    word = (asked or "").partition("?")[0]
    if asked is None:
        return
    if word == "NONE":
        yield error(
            "transports",
            f"{_VARIABLE}=NONE disables every transport",
            impact="no node starts, unless a profiles file defines transports",
            fix=f"unset {_VARIABLE}",
        )
    elif word not in _TRANSPORTS:
        unknown = f"{_VARIABLE}={asked} is unknown{did_you_mean(word, _TRANSPORTS)}"
        yield error(
            "transports",
            unknown if word else f"{_VARIABLE} is set but empty, which Fast DDS refuses",
            impact="Fast DDS ignores it and uses shared memory, which does not reach other containers and users",
            fix=_EXPECTED,
        )
    elif word == "SHM":
        yield info(
            "transports",
            f"{_VARIABLE}=SHM",
            impact="only nodes of the same user on this machine are reached",
            fix=f"nothing if all nodes are; otherwise: unset {_VARIABLE}",
        )


def _xml_fault(path: Path) -> str | None:
    try:
        expat.ParserCreate().Parse(path.read_bytes(), True)  # noqa: FBT003  expat's signature: this is all of it
    except OSError as error:
        return error.strerror
    except expat.ExpatError as error:
        return f"is not XML: {error}"
    return None
