"""Whatever names a recording, a relay or a file has: no command prints more of them than text."""

import asyncio
import html.parser
import json
import os
import random
import re
from pathlib import Path

import pytest
import yaml
from mcap.writer import Writer

from syncrelay.cli.boundary import guarded
from syncrelay.cli.dispatch import dispatch
from syncrelay.cli.stop import StopRequest
from syncrelay.status.as_document import status_of
from syncrelay.top.app import TopApp
from syncrelay.top.client import ask
from tests.cli.command import BAD, GOOD
from tests.cli.terminals import shown_on_terminal
from tests.faults.extent import chosen
from tests.hostile_names import assert_shown_safely, hostile_name
from tests.recordings.bag.making import rig
from tests.ros.cdr_messages import STORE, VECTOR
from tests.ros.configs import config, inputs
from tests.top import states
from tests.top.speaker import answering, speaking
from tests.top.terminal import Terminal

pytestmark = [pytest.mark.faults, pytest.mark.parametrize("seed", range(chosen(short=1, long=20)))]
_GOOD = ("/camera", "/lidar")


@pytest.fixture
def chance(seed):
    return random.Random(seed)


@pytest.fixture
def folder(tmp_path, chance):
    """A folder of a hostile name."""
    made = tmp_path / _file_name(chance)
    made.mkdir()
    return made


@pytest.fixture
def shown(capfd):
    """Runs a command in this process; gives its exit code and what it printed, which must be safe."""

    def run(*words):
        code = guarded(lambda: dispatch([str(word) for word in words], stop=StopRequest()))
        printed = capfd.readouterr()
        assert_shown_safely(printed.out)
        assert_shown_safely(printed.err)
        return code, printed.out, printed.err

    return run


def _file_name(chance) -> str:
    # Not UTF-8, too: Python has lone surrogates for such bytes.
    name = hostile_name(chance).replace("/", "").replace("\0", "") + "\udce4"
    return name.encode(errors="surrogateescape")[:200].decode(errors="surrogateescape")


def _recorded(path: Path, chance) -> Path:
    """A recording of two good topics and ten of hostile topics, types and encodings; QoS is hostile everywhere."""
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start("ros2")

        def channel(topic: str, type_name: str, encoding: str) -> int:
            profiles = yaml.safe_dump([{"reliability": hostile_name(chance), "durability": hostile_name(chance)}])
            text, _ = STORE.generate_msgdef(VECTOR, ros_version=2)
            schema = writer.register_schema(type_name, "ros2msg", text.encode())
            return writer.register_channel(topic, encoding, schema, {"offered_qos_profiles": profiles})

        good = {topic: channel(topic, VECTOR, "cdr") for topic in _GOOD}
        bad = [
            channel(f"/{hostile_name(chance)}", VECTOR, "cdr"),
            channel(f"/{hostile_name(chance)}", f"pkg/msg/{hostile_name(chance)}", "cdr"),
            channel("/encoded", VECTOR, hostile_name(chance)),
            channel("/typed", f"pkg/msg/{hostile_name(chance)}", "cdr"),
        ]
        for frame in rig(30):
            for number in (good[frame.topic], *bad):
                writer.add_message(number, frame.time, frame.payload, frame.time)
        writer.finish()
    return path


def _file(path: Path, *topics: str, **keys) -> Path:
    group = {"policy": "approximate_time", "slop": "5ms", "topics": inputs(dict.fromkeys(topics, VECTOR))}
    path.write_text(config({"front": group | keys}))
    return path


def test_names_of_a_recording(folder, chance, shown):
    bag = _recorded(folder / f"{_file_name(chance)}.mcap", chance)
    good, odd = _file(folder / "good.yaml", *_GOOD), _file(folder / "odd.yaml", "/encoded", "/typed", "/nowhere")
    assert shown("analyze", bag)[0] == 0
    assert shown("analyze", bag, *_GOOD)[0] == 0
    assert shown("analyze", bag, "--config", good, "--json")[0] == 0
    assert shown("analyze", bag, "/nowhere", "/typed")[0] == 1
    assert shown("analyze", bag, "--config", odd)[0] == 1
    assert shown("replay", bag, "--config", good, "-o", folder / f"{_file_name(chance)}.mcap")[0] == 0
    assert shown("replay", bag, "--config", odd)[0] == 1
    code, proposed, _ = shown("init", "--from-bag", bag)
    assert code == 0
    (group,) = yaml.safe_load(proposed)["groups"].values()
    assert sorted(topic["topic"] for topic in group["topics"]) == sorted(_GOOD)
    assert shown("init", "--from-bag", bag, "-o", folder / f"{_file_name(chance)}.yaml")[0] == 0
    bag.write_bytes(bag.read_bytes()[:5000])
    assert shown("replay", bag, "--config", good)[0] in (0, 1)
    assert shown("analyze", folder / _file_name(chance))[0] == 1


class _Page(html.parser.HTMLParser):
    """The texts of a page outside of its own scripts and styles, and how many elements there are of each kind."""

    def __init__(self) -> None:
        super().__init__()
        self.texts: list[str] = []
        self.elements: list[str] = []
        self._inside = ""

    def handle_starttag(self, tag, attrs):
        self.elements.append(tag)
        self._inside = tag
        self.texts += [value or "" for _, value in attrs]

    def handle_endtag(self, _tag):
        self._inside = ""

    def handle_data(self, data):
        if self._inside not in ("script", "style"):
            self.texts.append(data)


def test_names_in_the_html_report_are_text(folder, chance, shown):
    plain, odd = folder / "plain.mcap", folder / f"{_file_name(chance)}.mcap"
    good = _file(folder / "good.yaml", *_GOOD)
    good.write_text(good.read_text() + f"# a comment that turns {chr(0x202E)} </script><script>alert(1)</script>\n")
    pages = []
    for number, bag in enumerate((plain, odd)):
        _recorded(bag, chance)
        report = folder / f"{number}.html"
        assert shown("analyze", bag, "--config", good, "--html", report)[0] == 0
        pages.append(_Page())
        pages[-1].feed(report.read_text(encoding="utf-8"))
    assert pages[0].elements == pages[1].elements
    for text in pages[1].texts:
        assert {each for each in text if not each.isprintable()} <= {"\n"}


def _made_hostile(value, chance):
    """A document with every text in it that is no word of a list that is fixed, and keys of counts, hostile."""
    match value:
        case dict():
            counts = {"dropped", "dropped_lately"}
            fixed = {"phase", "level", "severity", "recent"}
            return {
                key: {hostile_name(chance): 3}
                if key in counts
                else each
                if key in fixed
                else _made_hostile(each, chance)
                for key, each in value.items()
            }
        case list():
            return [_made_hostile(each, chance) for each in value]
        case str():
            return hostile_name(chance)
        case _:
            return value


def _hostile_status(chance, **relay) -> bytes:
    told = _made_hostile(status_of(states.rig()).as_dict(), chance)
    told["relay"] |= relay
    # As it is, where JSON allows that: what a terminal must not see needs no escape there.
    return json.dumps(told, ensure_ascii=False).encode(errors="surrogatepass")


def test_names_that_a_relay_tells(chance, shown):
    document = _hostile_status(chance)
    with answering(document) as url:
        assert shown("top", "--once", "--url", url)[0] == 0
        code, told, _ = shown("top", "--once", "--json", "--url", url)
    assert (code, json.loads(told)) == (0, json.loads(document))
    with answering(_hostile_status(chance, pid=os.getppid(), reloads=0, refused_reloads=0)) as url:
        assert shown("reload", "--url", url)[0] == 1
    with answering(json.dumps({"relay": {hostile_name(chance): 1}, hostile_name(chance): []}).encode()) as url:
        assert shown("top", "--once", "--url", url)[0] == 1


async def _screens(url: str) -> list[str]:
    app = TopApp([ask(url)], period_s=0.1)
    async with app.run_test(size=(200, 60)) as pilot:
        await pilot.pause()
        seen = []
        for key in ("j", "s", "enter", "right", "escape", "question_mark"):
            seen += Terminal(app, pilot).lines
            await pilot.press(key)
            await pilot.pause()
        return seen


def test_names_on_the_screens_of_top(chance):
    with answering(_hostile_status(chance)) as url:
        lines = asyncio.run(_screens(url))
    assert [line for line in lines if not line.isprintable()] == []
    # Names are text and no markup.
    assert all(word in "".join(lines) for word in ("FORGED", "name", "\\n"))


@pytest.mark.parametrize("begin", [b"HTTP/1.1 404 ", b"HTTP/1.1 ", b""])
def test_answers_that_are_none(begin, chance, shown):
    reason = hostile_name(chance).replace("\n", "").replace("\r", "").encode(errors="replace")
    with speaking(lambda: iter([begin + reason + b"\r\n\r\n"])) as url:
        assert shown("top", "--once", "--url", url)[0] == 1
        assert shown("reload", "--url", url)[0] == 1


@pytest.mark.parametrize("form", ["text", "json", "github"])
def test_names_of_files_and_what_is_wrong_in_them(form, folder, chance, shown):
    text = GOOD.replace("/a", json.dumps(hostile_name(chance))).replace("exact_time", json.dumps(hostile_name(chance)))
    wrong = {
        "good": GOOD,
        "bad": BAD,
        "values": text,
        "keys": f"{json.dumps(hostile_name(chance))}: 1\n{GOOD}",
        "raw": GOOD.replace("front", hostile_name(chance).replace("\n", " ")),
        "broken": GOOD + "  [" + hostile_name(chance),
        "anchor": GOOD + "    &" + chr(0x202E) + " x: *" + chr(0x85),
        "tag": GOOD + "    queue_size: !" + chr(0x2066) + " 3",
    }
    for content in wrong.values():
        path = folder / f"{_file_name(chance)}.yaml"
        path.write_text(content, encoding="utf-8", errors="replace")
        _, out, err = shown("validate", "--format", form, path)
        if form == "json":
            json.loads(out)
        if form == "github":
            commands = [line for line in out.splitlines() if line.startswith("::") or "##[" in line]
            assert all(line.startswith(("::error file=", "::notice file=")) for line in commands), (out, err)
    assert shown("validate", "--format", form, folder / _file_name(chance))[0] == 1


def test_words_of_the_command_line(folder, chance, shown):
    good = folder / "good.yaml"
    good.write_text(GOOD)
    name = hostile_name(chance).replace("\0", "")
    assert shown(name)[0] == 2
    assert shown("validate", good, f"--{name}")[0] in (1, 2)
    assert shown("replay", name, "--config", name)[0] == 1
    assert shown("--config", good, "--group", name)[0] == 2
    assert shown("top", "--once", "--url", f"http://{name}")[0] in (1, 2)
    assert shown("demo", "--record", folder / f"{_file_name(chance)}.mcap", "--seconds", "1")[0] == 0


def test_on_a_terminal_only_our_own_colours_are_let_through(folder, chance):
    path = folder / f"{_file_name(chance)}.yaml"
    path.write_text(GOOD.replace("/a", json.dumps(hostile_name(chance))))
    code, shown = shown_on_terminal("validate", str(path), folder=folder)
    assert (code, "\x1b[31m" in shown) == (1, True)
    assert_shown_safely(re.sub("\x1b\\[[0-9]{1,2}m", "", shown.replace("\r\n", "\n")))
    assert set(re.findall("\x1b\\[([0-9]+)m", shown)) <= {"0", "1", "31", "34"}
