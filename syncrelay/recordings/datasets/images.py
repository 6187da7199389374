"""Images encoded as PNG or JPEG."""

import io
import sys
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, Final, Literal, NamedTuple, TypeAlias

import numpy as np
import pyarrow as pa

from syncrelay.errors import BagError

ImageFormat: TypeAlias = Literal["png", "jpeg"]
IMAGE: Final = "sensor_msgs/msg/Image"
NEEDED: Final = ("height", "width", "encoding", "is_bigendian", "step", "data")
"""The fields of an Image that its pixels are read from."""

# Higher levels take twice the time to save a few per cent.
_PNG_LEVEL: Final = 1
_JPEG_QUALITY: Final = 95
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
        rows = [None if not row.is_valid else self._row(row.as_py(), arrow) for row in decoded]
        return pa.chunked_array([pa.array(rows, type=arrow)])

    def _row(self, image: dict[str, Any], arrow: pa.StructType) -> dict[str, Any] | None:
        try:
            content = encoded(pixels_of(image, self._topic), self._format, self._topic)
        except FrameError:
            self.undecodable += 1
            return None
        whole = {**image, "format": self._format, "data": content}
        return {field.name: whole[field.name] for field in arrow}


def encoded(pixels: np.ndarray[Any, Any], image_format: ImageFormat, topic: str) -> bytes:
    """Return pixels as a file of this format; raises BagError where it cannot hold them."""
    from PIL import Image  # noqa: PLC0415  an extra's, and needed here alone

    if image_format == "jpeg" and pixels.dtype.itemsize > 1:
        raise BagError(f"{topic}: JPEG cannot hold 16 bit images: use --images {topic}=png")
    height, width = pixels.shape[:2]
    if image_format == "jpeg" and max(height, width) > _LONGEST_JPEG:
        limit = f"at most {_LONGEST_JPEG:,} pixels a side, and one has {width:,} x {height:,}"
        raise BagError(f"{topic}: JPEG holds images of {limit}: use --images {topic}=png")
    order = "<" if sys.byteorder == "little" else ">"
    plain = np.ascontiguousarray(pixels, dtype=pixels.dtype.newbyteorder(order))
    picture = Image.fromarray(plain)
    if image_format == "jpeg" and picture.mode == "RGBA":
        picture = picture.convert("RGB")
    file = io.BytesIO()
    if image_format == "png":
        picture.save(file, "PNG", compress_level=_PNG_LEVEL)
    else:
        picture.save(file, "JPEG", quality=_JPEG_QUALITY)
    return file.getvalue()
