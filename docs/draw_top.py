"""Draws docs/top.svg from a simulated rig: `PYTHONPATH=. python docs/draw_top.py`."""  # noqa: INP001  no package

import asyncio
from pathlib import Path

from picture import COLUMNS, LINES, draw
from rich.segment import SegmentLines

from syncrelay.status import RelayState
from syncrelay.status.as_document import status_of
from syncrelay.status.document import read_status
from syncrelay.top.app import TopApp
from syncrelay.top.client import Answer
from tests.top.rigs import Sensor, simulated
from tests.top.states import CAMERA, CLOUD, IMAGE, IMU, IMU_200, file, group

# No robot is asked while it is drawn.
_NEVER = 3600.0
_PICTURE = Path(__file__).parent / "top.svg"


def rig() -> RelayState:
    """Three groups: slop a little narrow, a camera whose clock is off, a queue too short."""
    groups = {
        "front": group({"/camera/image_raw": IMAGE, "/lidar/points": CLOUD}, slop="15ms"),
        "rear": group({"/rear/image_raw": IMAGE, "/lidar/points": CLOUD}),
        "inertial": group({"/lidar/points": CLOUD, "/imu/data": IMU}, queue_size=5),
    }
    sensors = {
        "/camera/image_raw": CAMERA,
        "/lidar/points": Sensor(10, lag_ms=48, jitter_ms=6, shift_ms=13, publishers=("/lidar_driver",)),
        "/rear/image_raw": Sensor(30, behind_ms=37_200, publishers=("/rear_camera",)),
        "/imu/data": IMU_200,
    }
    return simulated(file(**groups), sensors, seconds=60)


async def main() -> None:
    """Draw what a terminal shows of it."""
    told = status_of(rig()).as_json()
    app = TopApp([Answer("http://robot:9464", told, read_status(told))], period_s=_NEVER)
    async with app.run_test(size=(COLUMNS, LINES)) as pilot:
        await pilot.pause()
        # Textual's own picture has a frame that fetches a font.
        strips = app.screen._compositor.render_strips()  # noqa: SLF001
        draw(SegmentLines([list(strip) for strip in strips], new_lines=True), _PICTURE)


if __name__ == "__main__":
    asyncio.run(main())
