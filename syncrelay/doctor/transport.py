"""Fast DDS's own variables: how messages travel."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final

from syncrelay.config.wording import did_you_mean
from syncrelay.doctor.diagnosis import Diagnosis, know, mend

_VARIABLE: Final = "FASTDDS_BUILTIN_TRANSPORTS"
_PROFILES: Final = "FASTRTPS_DEFAULT_PROFILES_FILE"
_TRANSPORTS: Final = ("DEFAULT", "UDPv4", "SHM", "UDPv6", "DEFAULTv6", "LARGE_DATA", "LARGE_DATAv6")
_WITH_SHARED_MEMORY: Final = ("DEFAULT", "SHM", "DEFAULTv6", "LARGE_DATA", "LARGE_DATAv6")
_EXPECTED: Final = (
    "export FASTDDS_BUILTIN_TRANSPORTS=UDPv4    where there are containers or several users; else unset it"
)


@dataclass(frozen=True, slots=True)
class Transport:
    """The environment's variables, and why the profiles file that they name cannot be read."""

    environ: Mapping[str, str]
    profiles_fault: str | None = None


def uses_shared_memory(environ: Mapping[str, str]) -> bool:
    """Whether Fast DDS sends through /dev/shm by what the environment asks for, profiles files aside."""
    word = environ.get(_VARIABLE, "DEFAULT").partition("?")[0]
    return word in _WITH_SHARED_MEMORY or word not in _TRANSPORTS


def uses_defaults(environ: Mapping[str, str]) -> bool:
    """Whether Fast DDS carries messages as it does where nothing is said: over 0.5 MB of shared memory."""
    return environ.get(_VARIABLE, "DEFAULT") == "DEFAULT" and not environ.get(_PROFILES)


def check_transport(found: Transport) -> Iterator[Diagnosis]:
    """Yield values that Fast DDS refuses, and those that narrow whom data reach."""
    if found.profiles_fault:
        yield mend(
            "profiles_file",
            f"{_PROFILES}={found.environ[_PROFILES]}: {found.profiles_fault}",
            so="Fast DDS goes on without these profiles: QoS, transports and peers are not what the file says",
            do=f"mend the path (in a container: mount the file), or: unset {_PROFILES}",
        )
    asked = found.environ.get(_VARIABLE)
    word = (asked or "").partition("?")[0]
    if asked is None:
        return
    if word == "NONE":
        yield mend(
            "transports",
            f"{_VARIABLE}=NONE leaves no way for messages",
            so="no node starts, unless a profiles file brings transports of its own",
            do=f"unset {_VARIABLE}",
        )
    elif word not in _TRANSPORTS:
        unknown = f"{_VARIABLE}={asked} is unknown{did_you_mean(word, _TRANSPORTS)}"
        yield mend(
            "transports",
            unknown if word else f"{_VARIABLE} is set but empty, which Fast DDS refuses",
            so="Fast DDS goes on as if it were unset: with shared memory, which does not cross containers and users",
            do=_EXPECTED,
        )
    elif word == "SHM":
        yield know(
            "transports",
            f"{_VARIABLE}=SHM",
            so="only nodes of the same user on this machine are reached",
            do=f"nothing if all nodes are; else: unset {_VARIABLE}",
        )
