"""Decompression of chunks and messages with bounded memory, whatever size they claim to have."""

import bz2
from typing import Final, Protocol

import lz4.frame
import zstandard

from syncrelay.recordings.bag.effort import Effort

PACKED: Final = b"\x28\xb5\x2f\xfd"
"""What a payload begins with that rosbag2 compressed by itself (`--compression-mode message`); CDR begins with 0."""

NOT_UNPACKED: Final = (zstandard.ZstdError, ValueError, EOFError, MemoryError)
"""What unzstd raises."""

OF_NO_CONTENT: Final = "the payload cannot be decompressed"

# A block of Zstandard holds at most 128 KiB and takes at least 4 bytes.
_MOST_IN_A_BLOCK: Final = 1 << 17
_LEAST_BLOCK: Final = 4
_UNKNOWN: Final = -1
_FIRST_PIECE: Final = 1 << 20
# 1 KiB of Zstandard is at most 256 blocks, which unpack to 32 MiB.
_INPUT_PIECE: Final = 1 << 10
_ZSTD: Final = zstandard.ZstdDecompressor()


class _Decompressor(Protocol):
    """What the decompressors of bz2 and lz4 have in common."""

    @property
    def eof(self) -> bool: ...

    def decompress(self, data: bytes, max_length: int) -> bytes: ...


def plain(content: bytes, _effort: Effort) -> bytes:
    """Return content that is not compressed."""
    return content


def unbz2(packed: bytes, effort: Effort) -> bytes:
    """Unpack a bz2 stream; raises OSError, EOFError or ValueError where it is damaged."""
    return _unpacked(bz2.BZ2Decompressor(), packed, effort)


def unlz4(packed: bytes, effort: Effort) -> bytes:
    """Unpack an lz4 frame; raises RuntimeError, EOFError or ValueError where it is damaged."""
    return _unpacked(lz4.frame.LZ4FrameDecompressor(), packed, effort)


def unzstd(packed: bytes, effort: Effort) -> bytes:
    """Unpack a zstd frame; raises ZstdError, EOFError or ValueError where it is damaged."""
    effort.begin(len(packed))
    size = zstandard.frame_content_size(packed)
    if size == _UNKNOWN:
        return _streamed(packed, effort)
    if size > _MOST_IN_A_BLOCK * (len(packed) // _LEAST_BLOCK):
        raise ValueError(f"{len(packed)} bytes cannot hold the {size} that they claim")
    effort.unpack(size)
    return _ZSTD.decompress(packed)


def _unpacked(decompressor: _Decompressor, packed: bytes, effort: Effort) -> bytes:
    effort.begin(len(packed))
    pieces, most = [], _FIRST_PIECE
    while not decompressor.eof:
        # One byte more than is allowed, so that unpack() below notices.
        piece = decompressor.decompress(packed, min(most, effort.most + 1))
        if not piece and not decompressor.eof:
            raise EOFError("it ends too early")
        effort.unpack(len(piece))
        pieces.append(piece)
        packed, most = b"", 2 * most
    return b"".join(pieces)


def _streamed(packed: bytes, effort: Effort) -> bytes:
    """Unpack a frame without a size in its header, as streaming writers leave it."""
    stream = _ZSTD.decompressobj()
    pieces, place = [], 0
    while not stream.eof:
        if place >= len(packed):
            raise EOFError("it ends too early")
        pieces.append(stream.decompress(packed[place : place + _INPUT_PIECE]))
        effort.unpack(len(pieces[-1]))
        place += _INPUT_PIECE
    return b"".join(pieces)
