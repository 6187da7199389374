"""Images encoded as PNG or JPEG."""

import io
import os
import struct
import zlib
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from types import MappingProxyType
from typing import Any, Final, Literal, NamedTuple, TypeAlias

import numpy as np
import pyarrow as pa

from syncrelay.errors import BagError

ImageFormat: TypeAlias = Literal["png", "jpeg"]
IMAGE: Final = "sensor_msgs/msg/Image"
NEEDED: Final = ("height", "width", "encoding", "is_bigendian", "step", "data")
"""The fields of an Image that its pixels are read from."""

_PNG_BEGIN: Final = b"\x89PNG\r\n\x1a\n"
# PNG's names of colours, by the channels of a pixel; and its filter that stores each byte's difference to the pixel
# before, which packs pictures of cameras as well as the best of all five for each row, in an eighth of the time.
_COLOURS: Final = MappingProxyType({1: 0, 3: 2, 4: 6})
_SUB: Final = 1
# Higher levels take a tenth more time to save less than one per cent.
_PNG_LEVEL: Final = 1
_JPEG_QUALITY: Final = 95
# Of several recordings, each core has one: more threads for each would only wait.
_MOST_THREADS: Final = 4
# libjpeg's JPEG_MAX_DIMENSION. Pillow gives its error as one of the file that is written.
_LONGEST_JPEG: Final = 65_500


class _Pixels(NamedTuple):
    """An encoding: numpy's type, the number of channels, and the order that makes RGB of them."""

    kind: str
    channels: int
    order: tuple[int, ...] | None = None


_BAYER: Final = ("rggb", "bggr", "gbrg", "grbg")
_PIXELS: Final[Mapping[str, _Pixels]] = MappingProxyType(
    {
        "mono8": _Pixels("u1", 1),
        "8UC1": _Pixels("u1", 1),
        "rgb8": _Pixels("u1", 3),
        "8UC3": _Pixels("u1", 3, (2, 1, 0)),
        "bgr8": _Pixels("u1", 3, (2, 1, 0)),
        "rgba8": _Pixels("u1", 4),
        "8UC4": _Pixels("u1", 4, (2, 1, 0, 3)),
        "bgra8": _Pixels("u1", 4, (2, 1, 0, 3)),
        "mono16": _Pixels("u2", 1),
        "16UC1": _Pixels("u2", 1),
        **{f"bayer_{each}8": _Pixels("u1", 1) for each in _BAYER},
        **{f"bayer_{each}16": _Pixels("u2", 1) for each in _BAYER},
    }
)


class FrameError(Exception):
    """An image whose bytes are not what its own fields say."""


def pixels_of(image: Mapping[str, Any], topic: str) -> np.ndarray[Any, Any]:
    """Return an image's pixels, [height, width] or [height, width, channels], in RGB order where it has colours.

    Raises BagError for an encoding that no picture format holds, FrameError for bytes that are not such an image.
    """
    known = _PIXELS.get(image["encoding"])
    if known is None:
        raise BagError(
            f"{topic}: images of encoding {image['encoding']!r} cannot become PNG, JPEG or video; expected one of"
            f" {', '.join(_PIXELS)}: export it as it is, or without --images"
        )
    height, width, step = image["height"], image["width"], image["step"]
    kind = np.dtype(known.kind).newbyteorder(">" if image["is_bigendian"] else "<")
    row = width * known.channels * kind.itemsize
    data = image["data"]
    if not height or not width or step < row or len(data) < step * (height - 1) + row:
        raise FrameError(f"{len(data)} bytes are no {width} x {height} of {image['encoding']}")
    shape = (height, width, known.channels) if known.channels > 1 else (height, width)
    strides = (step, known.channels * kind.itemsize, kind.itemsize)[: len(shape)]
    found: np.ndarray[Any, Any] = np.ndarray(shape, kind, data, 0, strides)
    return found if known.order is None else found[..., list(known.order)]


class ImageColumn:
    """Encodes a column of Images."""

    def __init__(self, topic: str, image_format: ImageFormat) -> None:
        self._topic = topic
        self._format: Final = image_format
        self.undecodable = 0
        """How many images had other bytes than their fields say. They are null."""

    def arrow(self, decoded: pa.StructType, asked: frozenset[str]) -> pa.StructType:
        """Return the type of the column: the fields asked for, with `format` in place of the layout of pixels."""
        kept = [
            field for field in decoded if field.name in asked and field.name not in ("is_bigendian", "step", "data")
        ]
        more = [pa.field("format", pa.string()), pa.field("data", pa.binary())] if "data" in asked else []
        return pa.struct([*kept, *more])

    def encode(self, decoded: pa.ChunkedArray, arrow: pa.StructType) -> pa.ChunkedArray:
        """Return the encoded column; `arrow` is its type."""
        # The encoders let other threads run.
        with ThreadPoolExecutor(min(_MOST_THREADS, len(os.sched_getaffinity(0)))) as pool:
            rows = list(pool.map(lambda row: self._row(row, arrow), decoded))
        self.undecodable += rows.count(None) - decoded.null_count
        return pa.chunked_array([pa.array(rows, type=arrow)])

    def _row(self, row: pa.StructScalar, arrow: pa.StructType) -> dict[str, Any] | None:
        if not row.is_valid:
            return None
        image = {name: row[name].as_buffer() if name == "data" else row[name].as_py() for name in row}
        try:
            content = encoded(pixels_of(image, self._topic), self._format, self._topic)
        except FrameError:
            return None
        whole = {**image, "format": self._format, "data": content}
        return {field.name: whole[field.name] for field in arrow}


def encoded(pixels: np.ndarray[Any, Any], image_format: ImageFormat, topic: str) -> bytes:
    """Return pixels as a file of this format; raises BagError where it cannot hold them."""
    return _png(pixels) if image_format == "png" else _jpeg(pixels, topic)


def _png(pixels: np.ndarray[Any, Any]) -> bytes:
    """Return a PNG file (W3C, third edition) of pixels [height, width] or [height, width, channels]."""
    from isal import isal_zlib  # noqa: PLC0415  an extra's, and needed here alone

    height, width = pixels.shape[:2]
    channels = pixels.shape[2] if pixels.ndim > 2 else 1  # noqa: PLR2004  has channels
    size = pixels.dtype.itemsize
    plain = np.ascontiguousarray(pixels, dtype=pixels.dtype.newbyteorder(">")).view(np.uint8).reshape(height, -1)
    rows = np.empty((height, 1 + plain.shape[1]), np.uint8)
    first = channels * size
    rows[:, 0] = _SUB
    rows[:, 1 : 1 + first] = plain[:, :first]
    np.subtract(plain[:, first:], plain[:, :-first], out=rows[:, 1 + first :])
    head = struct.pack(">IIBBBBB", width, height, 8 * size, _COLOURS[channels], 0, 0, 0)
    parts = {b"IHDR": head, b"IDAT": isal_zlib.compress(rows, _PNG_LEVEL), b"IEND": b""}
    return _PNG_BEGIN + b"".join([_chunk(name, content) for name, content in parts.items()])


def _chunk(name: bytes, content: bytes) -> bytes:
    return struct.pack(">I", len(content)) + name + content + struct.pack(">I", zlib.crc32(content, zlib.crc32(name)))


def _jpeg(pixels: np.ndarray[Any, Any], topic: str) -> bytes:
    from PIL import Image  # noqa: PLC0415  an extra's, and needed here alone

    if pixels.dtype.itemsize > 1:
        raise BagError(f"{topic}: JPEG cannot hold 16 bit images: use --images {topic}=png")
    height, width = pixels.shape[:2]
    if max(height, width) > _LONGEST_JPEG:
        limit = f"at most {_LONGEST_JPEG:,} pixels a side, and one has {width:,} x {height:,}"
        raise BagError(f"{topic}: JPEG holds images of {limit}: use --images {topic}=png")
    picture = Image.fromarray(np.ascontiguousarray(pixels))
    file = io.BytesIO()
    (picture.convert("RGB") if picture.mode == "RGBA" else picture).save(file, "JPEG", quality=_JPEG_QUALITY)
    return file.getvalue()
