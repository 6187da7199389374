"""Names, figures and the whole state as text."""

import pytest

from syncrelay.status.as_document import status_of
from syncrelay.top import phrases
from syncrelay.top.client import Answer
from syncrelay.top.names import fitted_names, short_names
from syncrelay.top.pieces import sparkline
from syncrelay.top.plain import group_lines, plain_text
from tests.top import states


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


@pytest.mark.parametrize(
    ("milliseconds", "text"),
    [
        (None, "-"),
        (0.0, "0 s"),
        (0.518, "518 us"),
        (27.5, "27.5 ms"),
        (-37_200, "-37.2 s"),
        (-99_999_999, "-100000 s"),
        (1_760_000_027_000, "56 years"),
        (-1_760_000_027_000, "-56 years"),
    ],
)
def test_a_duration_fits_its_column(milliseconds, text):
    assert phrases.duration(milliseconds) == text
    assert len(text) <= 9


@pytest.mark.parametrize(
    ("dropped", "text"),
    [({}, "none"), ({"late": 1, "too_far": 66}, "66 too_far, 1 late"), ({"overflow": 3}, "3 overflow")],
)
def test_drops_are_named_the_most_frequent_first(dropped, text):
    assert phrases.drops(dropped) == text


@pytest.mark.parametrize("values", [(-100.0, 0.0, 10.0), (-100.0, 0.0, -10.0)])
def test_a_value_below_zero_is_drawn_as_zero(values):
    assert sparkline(values, 3)[:2] == "▁▁"


@pytest.mark.parametrize("state", states.ALL.values(), ids=states.ALL)
def test_all_that_is_found_is_said_in_lines_of_80_columns(state):
    text = plain_text(Answer("http://robot:9464", b"", status_of(state())))
    assert all(len(line) <= 80 or len(line.split()) == 1 for line in text.splitlines())
    flowing = " ".join(text.split())
    for group in state().groups:
        assert f"{group.facts.name}: " in flowing
        for finding in group.findings:
            assert finding.text in flowing
            assert (finding.suggestion or "") in flowing
        for each in group.facts.inputs:
            assert f"{each.name}" in flowing
            assert f"{each.counts.fed} received, {each.counts.matched} in sets" in flowing


@pytest.mark.parametrize("state", states.ALL.values(), ids=states.ALL)
def test_a_narrow_terminal_has_narrow_lines(state):
    for group in status_of(state()).groups:
        wide, narrow = list(group_lines(group)), list(group_lines(group, width=50))
        assert all(len(line) <= 50 or len(line.split()) == 1 for line in narrow)
        assert " ".join(wide).split() == " ".join(narrow).split()
        assert " ".join(group_lines(group, width=1)).split() == " ".join(wide).split()
