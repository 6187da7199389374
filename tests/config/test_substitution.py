import pytest

from syncrelay.config import ConfigError, load_text
from syncrelay.config.scalars import substitute

FILE = """\
version: 1
node: {{namespace: "{namespace}"}}
groups:
  front:
    policy: exact_time
    queue_size: {queue_size}
    topics:
      - {{topic: /a, type: sensor_msgs/msg/Image}}
      - {{topic: /b, type: sensor_msgs/msg/Image}}
"""


def queue_size(written, environ, **variables):
    text = FILE.format(queue_size=written, namespace="/r")
    return load_text(text, environ={**environ, **variables}).groups[0].options.queue_size


@pytest.mark.parametrize(
    ("text", "filled"),
    [
        ("plain", "plain"),
        ("${A}", "a"),
        ("/${A}/${EMPTY}x", "/a/x"),
        ("${A}${A}", "aa"),
        ("${A:-b}", "a"),
        ("${UNSET:-b}", "b"),
        ("${EMPTY:-b}", "b"),
        ("${UNSET:-}", ""),
        ("${UNSET:-a:-b c/}", "a:-b c/"),
        ("$$", "$"),
        ("$${A}", "${A}"),
        ("$$$$", "$$"),
        ("${DOLLAR}", "${A}$$"),
    ],
)
def test_variables_are_filled_in_once(text, filled):
    assert substitute(text, {"A": "a", "EMPTY": "", "DOLLAR": "${A}$$"}) == filled


@pytest.mark.parametrize("text", ["${UNSET}", "$A", "$", "a$", "${A", "${}", "${1}", "${A-b}", "${A:-${A}}", "$(A)"])
def test_an_unset_variable_and_what_only_looks_like_one_are_refused(text):
    with pytest.raises(ValueError, match=r"UNSET is not set|expected \${NAME}"):
        substitute(text, {"A": "a"})


def test_a_variable_in_quotes_is_read_as_without_for_braces_leave_no_other_way(environ):
    assert queue_size('"${Q}"', environ, Q="7") == 7


def test_an_empty_variable_is_an_empty_text(environ):
    text = FILE.format(queue_size=1, namespace="${NS:-}")
    assert load_text(text, environ=environ).node.namespace == ""


@pytest.mark.parametrize("value", ["5\n    slop: 3", "5, slop: 3", "{a: b}", "[5]", "5 # five", "*x", "!!int 5"])
def test_a_variable_adds_no_structure(value, environ):
    with pytest.raises(ConfigError) as raised:
        queue_size("${Q}", environ, Q=value)
    assert [(problem.path, problem.code) for problem in raised.value.problems] == [
        ("groups.front.queue_size", "wrong_type")
    ]


def test_variables_in_comments_are_nobodys_concern(environ):
    assert queue_size("5 # ${UNSET}", environ) == 5
