import pytest

from syncrelay.config import Problem, Severity, Span, render


def rendered(source, column, width):
    problem = Problem("f.yaml", "a.b", "text", "code", Span(3, column, width), source)
    return render([problem]).splitlines()[1:]


@pytest.mark.parametrize(
    ("source", "column", "width", "shown"),
    [
        pytest.param("  slopp: 1", 3, 5, ["    3 |   slopp: 1", "      |   ^^^^^"], id="plain"),
        pytest.param("a:\tb", 4, 1, ["    3 | a:    b", "      |       ^"], id="a tab before the token"),
        pytest.param("\tb", 1, 1, ["    3 |     b", "      | ^^^^"], id="a tab as the token"),
        pytest.param("名: é", 4, 1, ["    3 | 名: é", "      |     ^"], id="a wide character before"),
        pytest.param("a: 名前", 4, 2, ["    3 | a: 名前", "      |    ^^^^"], id="wide characters"),
        pytest.param("e\u0301: x", 5, 1, ["    3 | e\u0301: x", "      |    ^"], id="a combining accent before"),
        pytest.param("a: \u202eb", 5, 1, ["    3 | a: \ufffdb", "      |     ^"], id="a change of direction"),
        pytest.param("a:\xa0\u3000b", 5, 1, ["    3 | a:\ufffd\ufffdb", "      |     ^"], id="spaces like no other"),
        pytest.param("a: b  ", 4, 1, ["    3 | a: b", "      |    ^"], id="spaces at the end"),
        pytest.param("a:", 3, 1, ["    3 | a:", "      |   ^"], id="behind the end"),
        pytest.param("ab", 1, 99, ["    3 | ab", "      | ^^"], id="wider than the line"),
        pytest.param("", 1, 1, [], id="an empty line"),
    ],
)
def test_the_token_is_underlined_as_a_terminal_shows_it(source, column, width, shown):
    assert rendered(source, column, width) == shown


def test_a_long_line_is_cut_to_what_stands_round_the_token():
    line, underline = rendered("x" * 500 + " token " + "y" * 500, 502, 5)
    assert "token" in line
    assert line.count("…") == 2
    assert len(line) < 120
    at = underline.index("^")
    assert line[at : at + 5] == "token"


def test_a_token_longer_than_a_line_is_cut():
    line, underline = rendered("a: " + "x" * 5000, 4, 5000)
    assert len(line) < 120
    assert len(underline) < 120


def test_problems_of_the_file_as_a_whole_have_no_line():
    assert render([Problem("f.yaml", "", "is no file", "unreadable")]) == "f.yaml: is no file"


def test_notes_say_that_they_are_none():
    note = Problem("f.yaml", "", "types not checked", "not_checked", severity=Severity.NOTE)
    assert render([note]) == "f.yaml: note: types not checked"


def test_nothing_from_outside_reaches_the_terminal_as_a_control():
    problem = Problem("f\033[2J.yaml", "", "is no file", "unreadable")
    assert "\033" not in render([problem])
