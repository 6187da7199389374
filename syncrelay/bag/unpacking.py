"""What is compressed inside of recordings, unpacked within bounds: a length that lies does not cost its memory."""

import bz2
from collections.abc import Callable
from typing import Final, Protocol

import lz4.frame
import zstandard

LARGEST: Final = 1 << 30
"""Bytes that a chunk or a message may unpack to."""

# Zstandard packs no more than 128 KiB into a block, and no block into less than 4 bytes.
_MOST_IN_A_BLOCK: Final = 1 << 17
_LEAST_BLOCK: Final = 4
_UNKNOWN: Final = -1
_FIRST_PIECE: Final = 1 << 20
_INPUT_PIECE: Final = 1 << 14


class _Decompressor(Protocol):
    """As those of bz2 and lz4."""

    @property
    def eof(self) -> bool: ...

    def decompress(self, data: bytes, max_length: int) -> bytes: ...


def unbz2(packed: bytes) -> bytes:
    """Unpack a bz2 stream; raises OSError, EOFError or ValueError where it is damaged."""
    return _unpacked(bz2.BZ2Decompressor(), packed)


def unlz4(packed: bytes) -> bytes:
    """Unpack an lz4 frame; raises RuntimeError, EOFError or ValueError where it is damaged."""
    return _unpacked(lz4.frame.LZ4FrameDecompressor(), packed)


def zstd_unpacker() -> Callable[[bytes], bytes]:
    """Return what unpacks zstd frames; it raises ZstdError, EOFError or ValueError where one is damaged."""
    decompressor = zstandard.ZstdDecompressor()

    def unpack(packed: bytes) -> bytes:
        size = zstandard.frame_content_size(packed)
        if size == _UNKNOWN:
            return _streamed(decompressor, packed)
        if size > _MOST_IN_A_BLOCK * (len(packed) // _LEAST_BLOCK):
            raise ValueError(f"{len(packed)} bytes cannot hold the {size} that they claim")
        _require_bearable(size)
        return decompressor.decompress(packed)

    return unpack


def _unpacked(decompressor: _Decompressor, packed: bytes) -> bytes:
    pieces, size, most = [], 0, _FIRST_PIECE
    while not decompressor.eof:
        piece = decompressor.decompress(packed, most)
        if not piece and not decompressor.eof:
            raise EOFError("it ends too early")
        pieces.append(piece)
        size += len(piece)
        _require_bearable(size)
        packed, most = b"", 2 * most
    return b"".join(pieces)


def _streamed(decompressor: zstandard.ZstdDecompressor, packed: bytes) -> bytes:
    """Unpack a frame that does not tell its size, as those who write it piece by piece leave it."""
    stream = decompressor.decompressobj()
    pieces, size, place = [], 0, 0
    while not stream.eof:
        if place >= len(packed):
            raise EOFError("it ends too early")
        pieces.append(stream.decompress(packed[place : place + _INPUT_PIECE]))
        size += len(pieces[-1])
        _require_bearable(size)
        place += _INPUT_PIECE
    return b"".join(pieces)


def _require_bearable(size: int) -> None:
    if size > LARGEST:
        raise ValueError("it unpacks to more than 1 GiB")
