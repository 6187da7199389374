"""Draws docs/report.png, the report on a simulated rig: `PYTHONPATH=. python docs/draw_report.py`."""  # noqa: INP001  no package

import shutil
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from playwright.sync_api import sync_playwright

_PICTURE = Path(__file__).parent / "report.png"
_SIZE = {"width": 1000, "height": 1495}
_FILE = """\
version: 1
groups:
  fused:
    policy: approximate_time
    slop: 20ms
    queue_size: 4
    topics:
      - {topic: /demo/camera/image_raw, type: sensor_msgs/msg/Image, offset: -12ms, min_period: 28ms}
      - {topic: /demo/lidar/points, type: sensor_msgs/msg/PointCloud2, min_period: 86ms}
      - {topic: /demo/imu/data, type: sensor_msgs/msg/Imu, min_period: 7ms}
"""


def main() -> None:
    """Record the rig, measure it with a queue that is too short, and take the begin of the page."""
    with TemporaryDirectory() as folder:
        (Path(folder) / "fusion.yaml").write_text(_FILE)
        for words in (
            ["demo", "--record", "rig.mcap"],
            ["analyze", "rig.mcap", "--config", "fusion.yaml", "--html", "r.html"],
        ):
            subprocess.run([sys.executable, "-m", "syncrelay", *words], cwd=folder, check=True, capture_output=True)
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(executable_path=shutil.which("chromium"))
            page = browser.new_page(viewport=_SIZE)
            page.goto((Path(folder) / "r.html").as_uri())
            page.wait_for_selector("html[data-drawn]", state="attached")
            page.screenshot(path=_PICTURE)
            browser.close()


if __name__ == "__main__":
    main()
