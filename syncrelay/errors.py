"""What the user can mend: where it is, what was found, what was expected. Anything else is our bug."""

from errno import EDQUOT, EFBIG, ENOSPC
from typing import Final

NO_SPACE: Final = frozenset({EDQUOT, EFBIG, ENOSPC})
"""The system's errors that only writing gives, and that writing the next file would give too."""


class SyncRelayError(Exception):
    """Base of every error that a user can cause; its text is shown as it stands."""

    @property
    def outline(self) -> str:
        """Its text without anything that stands in the user's file: what anybody may know who asks over HTTP."""
        return str(self)


class TypeImportError(SyncRelayError):
    """A message type that exists by name could not be imported."""


class UnavailableError(SyncRelayError):
    """What a command needs is not installed, or cannot be used here."""


class RosUnavailableError(UnavailableError):
    """ROS cannot be used here: rclpy, its middleware or its environment is missing."""


class BagError(SyncRelayError):
    """A recording cannot be read, or not as the file asks for."""


class StorageError(BagError):
    """A recording in object storage or on a server cannot be reached, or not to its end."""


class OutputError(SyncRelayError):
    """A file or folder cannot be written; where the disk is full, neither could the next."""


class NothingToMatchError(SyncRelayError):
    """What was recorded or heard is too little to propose a file from."""


class UsageError(SyncRelayError):
    """The command line asks for something that is not there."""


class ListenError(SyncRelayError):
    """The relay cannot listen where the file says."""


class ReloadError(SyncRelayError):
    """A file that was read again asks for what a running relay cannot take on; `changes` are the keys at fault."""

    def __init__(self, text: str, *, changes: str = "") -> None:
        super().__init__(text, changes)
        self._text, self._changes = text, changes

    def __str__(self) -> str:
        return f"{self._text} ({self._changes})" if self._changes else self._text

    @property
    def outline(self) -> str:
        """See SyncRelayError."""
        return self._text
