"""`syncrelay init --from-bag BAG`: a first file, from what a recording shows."""

from contextlib import closing
from pathlib import Path

from syncrelay.bag import open_recording
from syncrelay.bag.analysis import propose
from syncrelay.cli.boundary import DONE, put, say
from syncrelay.cli.progress import progress_of
from syncrelay.errors import BagError


def init_from_bag(bag: str, output: str | None) -> int:
    """Print a file that gives sets of a recording, or write it where `output` says; 0.

    Raises BagError for a recording that cannot be read, or that has nothing to match.
    """
    with closing(open_recording([bag])) as recording:
        with progress_of(recording):
            text = propose(recording)
        for fault in recording.faults:
            say(f"syncrelay: {fault}")
    if output is None:
        put(text.rstrip())
        return DONE
    try:
        with Path(output).open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError as error:
        raise BagError(f"{output}: exists already, and is not overwritten") from error
    except OSError as error:
        raise BagError(f"{output}: cannot be written: {error.strerror}") from error
    say(f"syncrelay: {output} is written")
    return DONE
