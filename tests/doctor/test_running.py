"""What the relay will find when it starts: its file, its path, and where it tells its state."""

import socket

import pytest

from syncrelay.config import Listen, Problem
from syncrelay.config import Severity as Noted
from syncrelay.dataflow.backend import BackendName
from syncrelay.doctor.config_file import check_files, check_listen
from syncrelay.doctor.diagnosis import Severity
from syncrelay.doctor.examine import Examination
from syncrelay.doctor.installation import look_at_installation
from syncrelay.doctor.report import heading


@pytest.mark.parametrize("path", BackendName)
def test_the_first_line_says_how_messages_pass_on_each_path(path):
    examined = Examination(look_at_installation({}), "rmw_fastrtps_cpp", 0, "SUBNET", (), None, path.value)
    words = {
        BackendName.COMPILED: "messages through librcl in compiled code",
        BackendName.RCLPY: "messages through rclpy",
    }
    assert heading(examined).split(", ")[-1] == words[path]


def test_a_port_that_is_taken_is_an_info_where_the_file_asks_for_it():
    with socket.create_server(("127.0.0.1", 0)) as taken:
        ports = range(taken.getsockname()[1], taken.getsockname()[1] + 1)
        (found,) = check_listen(Listen("127.0.0.1", ports))
        assert (found.code, found.severity) == ("listen", Severity.INFO)
        assert found.what.startswith(f"cannot listen on 127.0.0.1:{ports[0]}: another process uses it")
        assert list(check_listen(Listen("127.0.0.1", ports, is_asked_for=False))) == []
    assert list(check_listen(Listen("127.0.0.1", range(1)))) == []
    assert list(check_listen(None)) == []


def test_what_is_hardly_meant_is_told_apart_from_what_could_not_be_checked():
    problems = [
        Problem("f.yaml", "", "no package", "package_missing", severity=Noted.NOTE, subject="my_msgs"),
        Problem("f.yaml", "", "no unit", "unit", severity=Noted.WARNING),
        Problem("f.yaml", "", "no tf2_msgs", "transforms_missing", severity=Noted.NOTE),
        Problem("f.yaml", "", "no .msg file", "not_checked", severity=Noted.NOTE),
    ]
    found = {each.code: each.what for each in check_files(["f.yaml"], problems)}
    assert found.keys() == {"package_missing", "transforms_missing", "file_doubtful", "not_checked"}
    assert "no tf2_msgs" not in found["not_checked"]
    assert "no unit" in found["file_doubtful"]
    assert "no unit" not in found["not_checked"]
