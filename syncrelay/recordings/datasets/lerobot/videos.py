"""Videos of a fixed rate: pictures are encoded one by one, and videos joined without encoding them again."""

from fractions import Fraction
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final, Self

import av
import numpy as np
from av.error import FFmpegError

from syncrelay.errors import BagError

CODEC: Final = "libx264"
# Each second frame is a key frame, as in LeRobot: to show any frame, at most two are decoded.
_KEYFRAMES: Final = 2
_QUALITY: Final = 23
_PRESET: Final = "veryfast"
_OPTIONS: Final = MappingProxyType(
    # Without B-frames, frame n of the file is frame n of the data. Macroblock trees are of little use with so many key
    # frames, and in one of fifty runs they give other bytes.
    {"g": str(_KEYFRAMES), "crf": str(_QUALITY), "preset": _PRESET, "bf": "0", "mbtree": "0"}
)
_PIXELS: Final = "yuv420p"


class VideoWriter:
    """Encodes pictures of one size. A context manager."""

    def __init__(self, path: Path, *, fps: int) -> None:
        self._path = path
        self._fps = fps
        self._container: Any = None
        self._stream: Any = None
        self._frames = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        if self._container is not None:
            try:
                if error == (None, None, None):
                    self._container.mux(self._stream.encode())
            finally:
                self._container.close()

    def add(self, pixels: np.ndarray[Any, Any], times: int) -> None:
        """Show a picture [height, width, RGB] for so many frames. Raises BagError for what cannot be encoded."""
        try:
            if self._container is None:
                self._open(*pixels.shape[:2])
            for _ in range(times):
                # A new one for each frame: the encoder may keep it.
                frame = av.VideoFrame.from_ndarray(pixels, format="rgb24")
                frame.pts, frame.time_base = self._frames, Fraction(1, self._fps)
                self._container.mux(self._stream.encode(frame))
                self._frames += 1
        except FFmpegError as error:
            height, width, _ = pixels.shape
            raise BagError(f"{self._path}: {width} x {height} cannot be encoded: {error}") from error

    def _open(self, height: int, width: int) -> None:
        self._container = av.open(str(self._path), "w")
        self._stream = self._container.add_stream(CODEC, self._fps, options=dict(_OPTIONS))
        self._stream.width, self._stream.height, self._stream.pix_fmt = width, height, _PIXELS
        self._stream.time_base = Fraction(1, self._fps)
        # With more threads the bytes depend on their number.
        self._stream.codec_context.thread_count = 1


def described(shape: list[int], *, fps: int) -> dict[str, Any]:
    """Return `info` of a video's feature in meta/info.json."""
    height, width, channels = shape
    return {
        "video.height": height,
        "video.width": width,
        "video.codec": "h264",
        "video.pix_fmt": _PIXELS,
        "video.fps": fps,
        "video.channels": channels,
        "has_audio": False,
        "video.g": _KEYFRAMES,
        "video.crf": _QUALITY,
        "video.preset": _PRESET,
        "video.fast_decode": 0,
        "video.video_backend": "pyav",
        "video.extra_options": {"bf": 0},
        "is_depth_map": False,
    }


class JoinedVideo:
    """A file that videos of one rate, size and encoder are appended to. A context manager."""

    def __init__(self, path: Path, *, fps: int) -> None:
        self._container = av.open(str(path), "w")
        self._stream: Any = None
        self._fps = fps
        self.frames = 0
        """How many frames it has."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_error: object) -> None:
        self._container.close()

    def append(self, path: Path, frames: int) -> None:
        """Append a video that has so many frames."""
        with av.open(str(path)) as video:
            (stream,) = video.streams
            if self._stream is None:
                self._stream = self._container.add_stream_from_template(stream)
            after = round(Fraction(self.frames, self._fps) / stream.time_base)
            for packet in video.demux(stream):
                # The last packet only ends the stream.
                if packet.dts is not None:
                    packet.pts, packet.dts = packet.pts + after, packet.dts + after
                    packet.stream = self._stream
                    self._container.mux(packet)
        self.frames += frames
