"""Files that cannot begin with a comment, or are too large to keep: their form is at fault, or unusual."""

import os

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

import syncrelay.config.yaml_tree
from syncrelay.config import ConfigError, load, load_text
from tests.cli.command import GOOD


@pytest.fixture
def error_of(tmp_path, monkeypatch, environ):
    """Loads bytes as the file f.yaml and gives the error's text."""
    monkeypatch.chdir(tmp_path)

    def load_bytes(content):
        (tmp_path / "f.yaml").write_bytes(content)
        with pytest.raises(ConfigError) as raised:
            load("f.yaml", environ=environ)
        return str(raised.value)

    return load_bytes


_EMPTY = "f.yaml: the file is empty, expected at least `version: 1` and `groups:`"


@pytest.mark.parametrize(
    ("content", "error"),
    [
        pytest.param(b"", _EMPTY, id="empty"),
        pytest.param(b"# later\n---\n", _EMPTY, id="comment"),
        pytest.param(b"~\n", _EMPTY, id="null"),
        pytest.param(
            b"version: 1\nname: fr\xf6nt\n",
            "f.yaml:2:9: byte 0xf6 at offset 19 is not UTF-8\n    2 | name: fr\ufffdnt\n      |         ^",
            id="latin-1",
        ),
        pytest.param(
            b"\xef\xbb\xbfname: \xc3\x28\n",
            "f.yaml:1:7: byte 0xc3 at offset 9 is not UTF-8\n    1 | name: \ufffd(\n      |       ^",
            id="broken UTF-8 behind a byte order mark",
        ),
        pytest.param(GOOD.encode("utf-16"), "f.yaml: the text is UTF-16, expected UTF-8", id="UTF-16"),
        pytest.param(
            b"name: fr\x00nt\n",
            "f.yaml:1:9: the character U+0000 is not allowed in YAML\n    1 | name: fr\ufffdnt\n      |         ^",
            id="NUL",
        ),
        pytest.param(
            b"a: \x1b[31mred\n",
            "f.yaml:1:4: the character U+001B is not allowed in YAML\n    1 | a: \ufffd[31mred\n      |    ^",
            id="escape",
        ),
        pytest.param(b"\n" * 60_000, "f.yaml: more than 50000 lines: is this the right file?", id="many lines"),
        pytest.param(b"a: 1\n" * 1_000_000, "f.yaml: larger than 1 MB: is this the right file?", id="a million lines"),
        pytest.param(
            b"\tversion: 1\n",
            "f.yaml:1:1: a tab in the indentation, expected spaces\n    1 |     version: 1\n      | ^^^^",
            id="tab at the start",
        ),
    ],
)
def test_a_file_that_is_no_text_of_ours_says_why(content, error, error_of):
    assert error_of(content) == error


@pytest.mark.parametrize("bracket", ["[", "{a: ", "- ", "a: [", "[{a: "])
def test_five_thousand_levels_are_refused_without_recursion(bracket, error_of):
    assert ": more than 50 levels of nesting\n" in error_of(bracket.encode() * 5_000)


def test_a_list_of_everything_twice_over_is_refused_before_it_is_built(error_of):
    levels = "".join(f"l{n}: &l{n} [{', '.join([f'*l{n - 1}'] * 9)}]\n" for n in range(1, 30))
    assert "with all aliases expanded the file has more than 200000 values" in error_of(
        f"l0: &l0 [x]\n{levels}".encode()
    )


def test_a_file_with_a_thousand_faults_shows_a_hundred(environ):
    text = GOOD + "".join(f"key{n}: 1\n" for n in range(1000))
    with pytest.raises(ConfigError) as raised:
        load_text(text, environ=environ)
    assert len(raised.value.problems) == 1000
    assert str(raised.value).endswith("\n... and 900 more")


def test_lines_are_counted_whatever_ends_them(error_of):
    for end in ("\n", "\r\n", "\r"):
        assert error_of(GOOD.replace("exact", "exakt").replace("\n", end).encode()).startswith("f.yaml:4:13: ")


def test_a_file_that_is_not_there_is_named_with_one_that_is(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "fusion.yaml").touch()
    (tmp_path / "other.yaml").touch()
    assert text_of("fusoin.yaml") == "fusoin.yaml: no such file, did you mean `fusion.yaml`?"
    assert text_of("fusion.yml") == "fusion.yml: no such file, did you mean `fusion.yaml`?"
    assert text_of("x/fusion.yaml") == "x/fusion.yaml: no such file"
    assert text_of("xyzzy") == "xyzzy: no such file"
    (tmp_path / "link.yaml").symlink_to("nowhere")
    assert text_of("link.yaml") == "link.yaml: no such file"


def test_what_is_no_file_says_what_it_is(tmp_path):
    assert text_of(str(tmp_path)) == f"{tmp_path}: no *.yaml or *.yml file in this directory"
    assert text_of("") == "'': is not a file name"
    assert text_of("a\0b") == "a\\x00b: is not a file name"
    assert text_of("/dev/zero") == "/dev/zero: is a device, expected a YAML file"
    assert "cannot be read" in text_of("x" * 5000)


@pytest.mark.skipif(os.geteuid() == 0, reason="root reads everything")
def test_a_file_that_may_not_be_read_says_so(tmp_path):
    (tmp_path / "f.yaml").touch(mode=0)
    assert text_of(str(tmp_path / "f.yaml")) == f"{tmp_path}/f.yaml: cannot be read: Permission denied"


def text_of(path):
    with pytest.raises(ConfigError) as raised:
        load(path, environ={})
    return str(raised.value)


@given(st.integers(0, len(GOOD)), st.integers(0, 12), st.text(alphabet="ab:- \n[]{}\"'&*|,", max_size=6))
def test_without_libyaml_a_file_is_judged_alike(start, length, inserted):
    text = GOOD[:start] + inserted + GOOD[start + length :]
    assert verdict(text, yaml.SafeLoader) == verdict(text, syncrelay.config.yaml_tree.LOADER)


def verdict(text, loader):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(syncrelay.config.yaml_tree, "LOADER", loader)
        try:
            return load_text(text, environ={}).groups
        except ConfigError as error:
            return str(error).partition(" ")[0] if error.problems[0].code != "yaml" else "yaml"
