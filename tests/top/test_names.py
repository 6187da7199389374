"""Topics by their short names."""

import pytest

from syncrelay.top.names import fitted_names, short_names


@pytest.mark.parametrize(
    ("topics", "names"),
    [
        (["/demo/camera/image_raw", "/demo/lidar/points"], ["camera", "lidar"]),
        (["/left/image", "/right/image"], ["left", "right"]),
        (["/camera/color", "/camera/depth"], ["color", "depth"]),
        (["/a/x", "/a/y", "/b/x"], ["/a/x", "/a/y", "/b/x"]),
        (["/a", "/a/b"], ["/a", "/a/b"]),
    ],
)
def test_topics_are_named_by_the_first_part_that_tells_them_apart(topics, names):
    assert short_names(topics) == names


@pytest.mark.parametrize(
    ("topics", "names"),
    [
        (["/camera/image", "/lidar"], ["/camera/image", "/lidar"]),
        (["/robot/camera_1/image_raw", "/robot/camera_2/image_raw"], ["…/camera_1/…", "…/camera_2/…"]),
        (["/robot_of_a_long_name/left", "/robot_of_a_long_name/right"], ["…/left", "…/right"]),
        (["/left/image_rect_color", "/right/image_rect_color"], ["/left/…", "/right/…"]),
        (["/robot/camera/image_raw", "/robot/camera"], ["/robot…a/image_raw", "/robot/camera"]),
        (["/front/camera/image_rect_color", "/lidar"], ["/front…_rect_color", "/lidar"]),
        (["/front/camera/image_rect_color"], ["/front…_rect_color"]),
    ],
    ids=["they fit", "before and behind", "before", "behind", "one begins the other", "nothing equal", "alone"],
)
def test_topics_that_do_not_fit_lose_what_does_not_tell_them_apart(topics, names):
    assert fitted_names(topics, 18) == names
