"""What the doctor makes of a file's problems: each kind has its own advice."""

from syncrelay.config import Problem, Severity
from syncrelay.doctor.config_file import check_files


def test_what_is_hardly_meant_is_told_apart_from_what_could_not_be_checked():
    problems = [
        Problem("f.yaml", "", "no package", "package_missing", severity=Severity.NOTE, subject="my_msgs"),
        Problem("f.yaml", "", "no unit", "unit", severity=Severity.WARNING),
        Problem("f.yaml", "", "no .msg file", "not_checked", severity=Severity.NOTE),
    ]
    found = {each.code: each.what for each in check_files(["f.yaml"], problems)}
    assert found.keys() == {"package_missing", "file_doubtful", "not_checked"}
    assert "no unit" in found["file_doubtful"]
    assert "no unit" not in found["not_checked"]
