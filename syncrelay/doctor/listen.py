"""Where the relay will tell its state over HTTP."""

from collections.abc import Iterator

from syncrelay.config import Listen
from syncrelay.doctor.diagnosis import Diagnosis, info
from syncrelay.errors import ListenError


def check_listen(listen: Listen | None) -> Iterator[Diagnosis]:
    """Yield that the address that the file asks for cannot be had; the relay that runs already may be why."""
    if listen is None or not listen.is_asked_for:
        return
    # The web server's packages are not needed to look at a broken installation.
    from syncrelay.status.server import Server  # noqa: PLC0415

    try:
        with Server(listen):
            pass
    except ListenError as error:
        yield info(
            "listen",
            str(error),
            impact="the relay exits at once with code 1, unless it is the one that listens there already",
            fix="`syncrelay top` shows whether a relay answers there; if not, give `metrics` another `listen`",
        )
