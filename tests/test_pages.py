"""What the README and the pages of docs/ show is true: files are valid, commands exist, errors are as shown."""

import json
import re
from pathlib import Path

import pytest
import yaml

from syncrelay.config import load_text
from syncrelay.config.difference import difference, difference_lines
from syncrelay.config.file import file_format
from syncrelay.config.graph import as_mermaid, as_text, drawing_of
from syncrelay.recordings.cases import check, load_suite_text
from tests.cli.command import run_here
from tests.sync.support.timeline import play_group
from tests.test_launch_files import declared

_ROOT = Path(__file__).parents[1]
_DOCS = _ROOT / "docs"
# `make docs` copies files of the repository there.
_OF_DOCS = [page for page in sorted(_DOCS.rglob("*.md")) if not page.is_relative_to(_DOCS / "repository")]
_PAGES = {path: path.read_text() for path in [_ROOT / "README.md", *_OF_DOCS]}
_BLOCK = re.compile(r"^```(\w+)\n(.*?)^```", re.DOTALL | re.MULTILINE)
_BLOCKS = [block for page in _PAGES.values() for block in _BLOCK.findall(page)]
_YAML = [text for kind, text in _BLOCKS if kind == "yaml"]
_FILES = [text for text in _YAML if text.startswith("version:") and "\ncases:" not in text]
# test_consoles.py runs the one of the tutorial.
_SUITES = [text for text in _YAML if "\ncases:" in text and "config: ../" in text]
_SHOWN = [line.removeprefix("$ ") for kind, text in _BLOCKS if kind == "console" for line in text.splitlines()]
_INLINE = [each for page in _PAGES.values() for each in re.findall(r"`((?:syncrelay|make|pip install) [^`]+)`", page)]
_WORKSPACE = _ROOT / "docs" / "howto" / "workspace.md"
_CHOICE = _ROOT / "docs" / "howto" / "choose_policy_slop_queue.md"
_SHELL = [line.split("  #")[0] for kind, text in _BLOCKS if kind == "sh" for line in text.splitlines()]
_SHOWN += [line.removeprefix("ros2 run syncrelay ") for line in _SHELL if line.startswith("ros2 run syncrelay ")]
_LAUNCHED = [line.split(maxsplit=3)[3] for line in _SHELL if line.startswith("ros2 launch syncrelay ")]
_COMMANDS = sorted({command for command in [*_SHOWN, *_INLINE] if command})


@pytest.mark.parametrize("text", _FILES, ids=range(len(_FILES)))
def test_every_file_that_a_page_shows_is_in_order(text):
    assert load_text(text).groups


def test_every_test_file_that_a_page_shows_is_in_order_and_passes_where_it_can(tmp_path):
    (tmp_path / "fusion.yaml").write_text(_FILES[0])
    (tmp_path / "tests").mkdir()
    for text in _SUITES:
        suite = load_suite_text(text, name=str(tmp_path / "tests" / "fusion.yaml"))
        assert [each.case.name for each in check(suite) if not each.passed and each.case.recording is None] == []
    assert _SUITES


def test_the_workflow_runs_commands_that_exist():
    (workflow,) = [yaml.safe_load(text) for text in _YAML if "runs-on:" in text]
    runs = [step["run"] for step in workflow["jobs"]["test"]["steps"] if "run" in step]
    commands = [run.removeprefix("syncrelay ").split() for run in runs if run.startswith("syncrelay ")]
    assert [words[0] for words in commands] == ["validate", "test"]
    assert all(_is_syncrelay_command(words) for words in commands)


@pytest.mark.parametrize("command", _LAUNCHED)
def test_every_launch_that_a_page_shows_has_its_arguments(command):
    file, *arguments = command.split()
    # groups.launch.py sets the group and the name of each relay; all other arguments pass through.
    takes = declared("relay.launch.py") - ({"group", "node_name"} if file == "groups.launch.py" else set())
    assert (_ROOT / "launch" / file).is_file()
    assert {argument.split(":=")[0] for argument in arguments} <= takes


def test_every_argument_of_the_launch_file_is_explained():
    assert [name for name in declared("relay.launch.py") if f"\n| `{name}` |" not in _PAGES[_WORKSPACE]] == []


@pytest.mark.parametrize("command", _COMMANDS)
def test_every_command_that_a_page_shows_exists(command):
    program, *words = command.split(" > ", maxsplit=1)[0].split()
    check = {"make": _is_make_target, "pip": _is_known_install, "syncrelay": _is_syncrelay_command}[program]
    assert check(words), command


def _is_make_target(words):
    targets = re.findall(r"^([\w-]+):", (_ROOT / "Makefile").read_text(), re.MULTILINE)
    return words[0] in targets


def _is_known_install(words):
    return " ".join(words) in {
        "install .",
        "install '.[ros,top]'",
        "install '.[ros,top,recordings]'",
        "install '.[top]'",
        "install '.[recordings]'",
        "install '.[kilted]'",
        "install '.[ros,test,lint]'",
        "install '.[datasets,fleet]'",
        "install '.[datasets]'",
        "install ./examples/led-by",
        "install -e 'src/syncrelay[top,recordings]'",
    }


def _is_syncrelay_command(words):
    # The help of a command, or of the relay, names all of its options.
    command = [] if words[0].startswith("-") else [words[0]]
    shown = run_here(*command, "--help", folder=_ROOT)
    options = [word for word in words if word.startswith("--")]
    return shown.returncode == 0 and all(option in shown.stdout for option in options)


def test_a_command_that_does_not_exist_would_be_noticed():
    assert not _is_syncrelay_command(["--confg", "fusion.yaml"])
    assert not _is_syncrelay_command(["validat", "fusion.yaml"])
    assert not _is_make_target(["demos"])


def test_the_error_that_a_page_shows_is_the_one_that_comes(tmp_path):
    shown = {text.strip() for _, text in _BLOCKS if text.startswith("fusion.yaml:") and "slopp" in text}
    (tmp_path / "fusion.yaml").write_text(_FILES[0].replace("slop:", "slopp:"))
    run = run_here("validate", "fusion.yaml", folder=tmp_path)
    assert run.returncode == 1
    assert shown == {(run.stdout + run.stderr).strip()}


def test_the_drawing_and_the_difference_that_a_page_shows_are_those_that_come():
    old = load_text(_FILES[0])
    (shown,) = [text for kind, text in _BLOCKS if kind == "mermaid"]
    drawing = drawing_of(old, title="fusion.yaml")
    assert "\n".join(as_mermaid(drawing)) == shown.rstrip()
    assert "\n".join(as_text(drawing)) in [text.rstrip() for kind, text in _BLOCKS if kind == "text"]
    (shown,) = [text for kind, text in _BLOCKS if kind == "text" and text.startswith("a reload ")]
    found = difference(old, load_text(_FILES[0].replace("20ms", "30ms")))
    assert "\n".join(difference_lines(found)) == shown.rstrip()


@pytest.mark.parametrize("page", _PAGES, ids=lambda page: page.name)
def test_every_link_to_a_file_or_heading_of_ours_leads_somewhere(page):
    targets = [target for target in re.findall(r"\]\(([^)]+)\)", _prose(_PAGES[page])) if "://" not in target]
    assert [target for target in targets if not _leads_somewhere(page, target)] == []


def test_the_front_page_of_docs_names_every_page():
    index = _DOCS / "index.md"
    named = {index.parent / target for target in re.findall(r"\]\(([\w/]+\.md)\)", _PAGES[index])}
    assert {*_OF_DOCS} - named - {index} == set()


@pytest.mark.parametrize("page", [_ROOT / "README.md", _DOCS / "index.md"], ids=lambda page: page.name)
def test_a_page_has_the_same_name_in_its_title_and_in_what_lists_it(page):
    links = re.findall(r"(?<!!)\[([^\]]+)\]\(([\w/]+\.md)\)", _prose(_PAGES[page]))
    listed = {(name, page.parent / target) for name, target in links if (page.parent / target) in _OF_DOCS}
    titles = {path: re.findall(r"^# (.+)$", _prose(_PAGES[path]), re.MULTILINE)[0] for path in _OF_DOCS}
    # In the midst of a sentence a name may begin with a small letter.
    wrong = [(name, titles[path]) for name, path in listed if name.lower() != titles[path].lower()]
    assert listed
    assert wrong == []


def test_the_sidebar_has_six_groups():
    groups = re.findall(r"^## (.+)$", _PAGES[_DOCS / "index.md"], re.MULTILINE)
    assert groups == ["Start", "Values", "Watch", "Deploy", "Recordings", "Come from"]


def _prose(text):
    return re.sub(r"^```.*?^```", "", text, flags=re.MULTILINE | re.DOTALL)


def _leads_somewhere(page, target):
    path, _, anchor = target.partition("#")
    found = page.parent / path if path else page
    return found.exists() and (not anchor or anchor in _anchors(found.read_text()))


def _anchors(text):
    """The anchors that GitHub gives to headings."""
    headings = re.findall(r"^#+ (.+)$", _prose(text), re.MULTILINE)
    return [re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in headings]


def test_a_link_that_leads_nowhere_would_be_noticed():
    assert _leads_somewhere(_CHOICE, "#which-queue_size")
    assert not _leads_somewhere(_CHOICE, "#which-depth")
    assert not _leads_somewhere(_CHOICE, "none.md")
    assert not _leads_somewhere(_CHOICE, "../reference/node.md#which-queue_size")


_TIMELINES = [text for kind, text in _BLOCKS if kind == "timeline"]


@pytest.mark.parametrize("text", _TIMELINES, ids=lambda text: text.split(",")[0].split()[0])
def test_every_drawing_of_a_policy_is_what_the_policy_does(text):
    keys, drawing = text.split("\n", maxsplit=1)
    names = dict.fromkeys(line.split()[0] for line in drawing.splitlines() if "|" in line)
    topics = [{"topic": f"/{name}", "type": "sensor_msgs/msg/Image"} for name in names]
    policy, *options = keys.split(", ")
    group = {"policy": policy, **dict(option.split(": ") for option in options), "topics": topics}
    (resolved,) = load_text(json.dumps({"version": 1, "groups": {"drawn": group}})).groups
    left, drawn = play_group(resolved.engine(), drawing)
    assert drawn
    assert left == drawn


def test_every_policy_has_a_drawing_and_a_row():
    for policy in file_format().groups:
        assert any(text.startswith(policy) for text in _TIMELINES)
        assert f"| `{policy}` |" in _PAGES[_CHOICE]


def test_every_python_block_that_a_page_shows_is_python():
    shown = [text for kind, text in _BLOCKS if kind == "python"]
    for text in shown:
        compile(text, "page", "exec")
    assert shown
