"""`syncrelay init --from-bag BAG`: a first file, from what a recording shows."""

from contextlib import closing

from syncrelay.bag import open_recording
from syncrelay.bag.analysis import propose
from syncrelay.cli.boundary import DONE, put, say
from syncrelay.cli.new_file import write_new
from syncrelay.cli.progress import progress_of


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
    write_new(output, text)
    return DONE
