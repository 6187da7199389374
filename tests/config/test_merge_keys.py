"""Merge keys and keys of the user's own: what a file with them says is what it says with all of it written out."""

from typing import Any

import pytest

from syncrelay.config import ConfigError, load_text
from syncrelay.config.load import spelt_out
from tests.config.test_valid import FOLDER

_TOPICS = "[{topic: /a, type: sensor_msgs/msg/Image}, {topic: /b, type: sensor_msgs/msg/Image}]"
_FILE = f"""\
version: 1
x-one: &one {{policy: approximate_time, slop: 10ms, x-note: "$$ and *"}}
x-two: &two {{slop: 20ms, queue_size: 20}}
x-both: &both
  <<: [*one, *two]
  max_wait: 1s
defaults: {{queue_size: 5, every: 2}}
groups:
  a: {{<<: *one, topics: &topics {_TOPICS}}}
  b: {{<<: [*two, *one], topics: *topics}}
  c: {{topics: *topics, slop: 30ms, <<: *both, queue_size: 7}}
"""


def test_own_keys_come_first_then_the_first_that_is_merged_then_defaults(environ):
    groups: Any = load_text(_FILE, environ=environ).groups
    assert [(each.options.slop // 1_000_000, each.options.queue_size, each.options.every) for each in groups] == [
        (10, 5, 2),
        (20, 20, 2),
        (30, 7, 2),
    ]
    assert [each.options.max_wait for each in groups] == [None, None, 1_000_000_000]


@pytest.mark.parametrize("text", [_FILE, *(path.read_text() for path in sorted(FOLDER.glob("*.yaml")))])
def test_what_is_spelt_out_says_the_same(text, environ):
    written = spelt_out(text, environ=environ)
    assert "<<" not in written or "<<" not in text
    assert load_text(written, environ=environ) == load_text(text, environ=environ)


@pytest.mark.parametrize("place", ["{}", "groups: {{a: {}}}", "node: {}", "groups: {{a: {{topics: [{}]}}}}"])
def test_a_key_of_the_users_own_may_stand_wherever_keys_of_ours_do(place, environ):
    def unknown(keys: str) -> list[str]:
        with pytest.raises(ConfigError) as raised:
            load_text(place.format(keys), environ=environ)
        return [each.path.split(".")[-1] for each in raised.value.problems if each.code == "unknown_key"]

    assert unknown("{x-note: {a: [1]}, x_note: 1}") == ["x_note"]
    assert unknown("{X-Note: 1, x-: 1}") == ["X-Note"]
