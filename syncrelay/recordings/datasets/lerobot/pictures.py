"""Images of messages as RGB pixels, as LeRobot's videos hold them."""

import io
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, Final

import numpy as np
import pyarrow as pa

from syncrelay.config.wording import one_of
from syncrelay.errors import BagError
from syncrelay.recordings.datasets.images import IMAGE, NEEDED, FrameError, pixels_of

COMPRESSED: Final = "sensor_msgs/msg/CompressedImage"
FIELDS: Final[Mapping[str, tuple[str, ...]]] = MappingProxyType({IMAGE: NEEDED, COMPRESSED: ("data",)})
"""The fields that are needed of each type that can become video."""

# The formats that cameras send. For some of its other formats Pillow runs other programs.
_FORMATS: Final = ("JPEG", "PNG", "WEBP", "TIFF")


class PictureSource:
    """The topic of a video. All its images must have one size."""

    def __init__(self, topic: str, type_name: str) -> None:
        """Raise BagError for a type that holds no images."""
        if type_name not in FIELDS:
            raise BagError(f"{topic} is {type_name or 'of no known type'}, expected {one_of(FIELDS)}")
        self.topic: Final = topic
        self.shape: tuple[int, ...] = ()
        """Height, width and 3; empty until the first image."""
        self._read = self._raw if type_name == IMAGE else self._compressed

    def pixels(self, message: pa.StructScalar) -> np.ndarray[Any, Any]:
        """Return [height, width, RGB] in uint8.

        Raises FrameError for bytes that are not an image, and BagError for an image that a video cannot hold or whose
        size differs from the first one's.
        """
        rgb = np.ascontiguousarray(self._read(message))
        height, width, _ = rgb.shape
        if not self.shape:
            if height % 2 or width % 2:
                raise BagError(f"{self.topic}: images of {width} x {height} cannot become video, expected even numbers")
            self.shape = rgb.shape
        elif rgb.shape != self.shape:
            raise BagError(
                f"{self.topic} has images of {self.shape[1]} x {self.shape[0]} and of {width} x {height}: a video has"
                " one size"
            )
        return rgb

    def _raw(self, message: pa.StructScalar) -> np.ndarray[Any, Any]:
        image = {name: message[name].as_py() for name in NEEDED if name != "data"}
        encoding = image["encoding"]
        if encoding.startswith("bayer"):
            raise BagError(f"{self.topic}: images of encoding {encoding!r} have no colours yet: debayer them first")
        pixels = pixels_of({**image, "data": message["data"].as_buffer()}, self.topic)
        if pixels.dtype.itemsize > 1:
            raise BagError(f"{self.topic}: images of encoding {encoding!r} have 16 bits a pixel, a video holds 8")
        is_grey = len(pixels.shape) == len(("height", "width"))
        return np.stack([pixels] * 3, axis=-1) if is_grey else pixels[..., :3]

    def _compressed(self, message: pa.StructScalar) -> np.ndarray[Any, Any]:
        from PIL import Image, UnidentifiedImageError  # noqa: PLC0415  needed here alone

        try:
            with Image.open(io.BytesIO(message["data"].as_buffer()), formats=_FORMATS) as picture:
                if picture.mode.startswith(("I", "F")):
                    raise BagError(f"{self.topic}: {picture.format} images of mode {picture.mode} are no 8 bit colours")
                return np.asarray(picture.convert("RGB"))
        except (UnidentifiedImageError, OSError, SyntaxError, ValueError, Image.DecompressionBombError) as error:
            raise FrameError(str(error)) from error
