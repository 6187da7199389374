"""What each command refuses, in one table: the exit code, the words, and how its one sentence on stderr begins."""

import shlex

import pytest

from syncrelay.cli import run as relay
from syncrelay.cli.commands import COMMANDS
from syncrelay.errors import UsageError
from tests.cli.command import GOOD, example, run, run_here
from tests.recordings.bag.making import rig, write_mcap
from tests.ros.cdr_messages import VECTOR
from tests.ros.configs import config, inputs
from tests.status.support.serving import running
from tests.top import states

_LONG = "x" * 300
_NOBODY = r"no relay answers at GONE\n  GONE: nothing listens there\n"
_REFUSED = f"""
2 | validat f.yaml | unknown command validat, did you mean `validate`?
2 | xyzzy | unknown command xyzzy
2 | f.yaml | f.yaml is not a command
2 | --confg f.yaml | unknown argument --confg, did you mean `--config`?
2 | --config f.yaml g.yaml | unknown argument g.yaml
2 | --config f.yaml -r __ns:=/a | unknown argument -r
2 | --ros-args --config f.yaml | --config FILE is missing
2 | --config f.yaml --config link.yaml | f.yaml and link.yaml are the same file: name each file once
2 | --config f.yaml --group frnt | --group frnt: f.yaml has no such group, did you mean `front`?
2 | validate | the following arguments are required: FILE
2 | validate --together f.yaml ./f.yaml | f.yaml and ./f.yaml are the same file: name each file once
2 | validate - - | - is named twice: name each file once
2 | validate --together - - | - is named twice: name each file once
2 | diff - - | standard input can be read only once
2 | schema f.yaml | unknown argument f.yaml
2 | completion tcsh | argument SHELL: invalid choice: 'tcsh'
2 | demo --seconds nan | argument --seconds: expected a number above 0, found nan
2 | demo --record new.mcap --seconds 1e308 | argument --seconds: expected a number of at most 1000000000, found 1e308
1 | demo --record rig.mcap --seconds 1 | rig.mcap: already exists and is not overwritten
2 | doctor --seconds 3 | --seconds N needs --live: it is how long to observe the graph
2 | doctor --live --seconds 0 | argument --seconds: expected a number above 0, found 0
2 | doctor --config f.yaml --config f.yaml | f.yaml is named twice: name each file once
2 | analyze | the following arguments are required: BAG
2 | analyze rig.mcap --config f.yaml --config g.yaml | --config was given more than once: analyze takes one file
2 | analyze rig.mcap --html new.html | name a file with --config FILE, or the topics to match: there is
2 | analyze rig.mcap --write new.yaml | name a file with --config FILE, or the topics to match: there is
2 | analyze rig.mcap /camera --config f.yaml | name a file with --config FILE, or the topics to match, not both
2 | analyze rig.mcap /camera | name 2 topics or more
2 | analyze rig.mcap rig.mcap --config f.yaml --html new.html | --write and --html are for one recording, found 2
2 | analyze rig.mcap --jobs 2 | unknown argument --jobs: that is an option of `export` and `fleet`
2 | fleet analyze rig.mcap | the following arguments are required: --into
2 | fleet analize rig.mcap --into new | argument COMMAND: invalid choice: 'analize'
2 | fleet analyze rig.mcap --into new --time-limit 0s | argument --time-limit: expected a duration above 0, found 0s
2 | fleet analyze rig.mcap --into new --json | --json and --robot are about groups
2 | fleet analyze rig.mcap --config f.yaml --into new --compression none | --compression goes with fleet replay
2 | fleet analyze rig.mcap --config f.yaml --config g.yaml --into new | --config was given more than once: analyze takes
2 | fleet analyze rig.mcap /camera --config f.yaml --into new | name a file with --config FILE, or the topics to match,
2 | fleet analyze rig.mcap --config f.yaml --into new --robot '{{day}}/*' | --robot {{day}}/*: expected {{robot}} once
2 | fleet replay rig.mcap --into new | the following arguments are required: --config
2 | fleet replay rig.mcap --config f.yaml --into new --robot x | --robot goes with fleet analyze
2 | fleet replay rig.mcap --config f.yaml --into new --seed 1 | --seed goes with --what-if
2 | fleet replay rig.mcap --config f.yaml --into new --time-limit 2 | argument --time-limit: `2` has no unit
1 | analyze rig.mcap /camera /lidr | /lidr is not in the recording, did you mean `/lidar`?
1 | analyze none.mcap /camera /lidar | none.mcap: no such file or folder
1 | analyze {_LONG} /camera /lidar | {_LONG}: cannot be read: File name too long
2 | replay rig.mcap | the following arguments are required: --config
2 | replay --config f.yaml | the following arguments are required: BAG
2 | replay x.mcap --config f.yaml --config f.yaml | f.yaml is named twice: name each file once
2 | replay rig.mcap --config f.yaml --seed 1 | --seed goes with --what-if
2 | replay rig.mcap --config f.yaml --seed -1 | argument --seed: expected a whole number of 0 or more, found -1
2 | replay rig.mcap --config f.yaml --what-if 'lat: /x 3ms' | argument --what-if: `lat: /x 3ms` is not a fault, did you
2 | replay rig.mcap --config f.yaml --what-if 'dead: /lida' | `dead: /lida`: there is no topic `/lida`, did you mean
1 | replay none.mcap --config f.yaml | none.mcap: no such file or folder
1 | replay {_LONG} --config f.yaml | {_LONG}: cannot be read: File name too long
1 | replay f.yaml --config f.yaml | f.yaml: is not a recording
1 | replay rig.mcap --config g.yaml | g.yaml: no such file
1 | replay rig.mcap --config f.yaml -o f.yaml | f.yaml: already exists
2 | init | one of the arguments --from-bag --from-graph is required
2 | init --from-bag rig.mcap --from-graph | argument --from-graph: not allowed with argument --from-bag
2 | init --from-bag rig.mcap --seconds 3 | --seconds N needs --from-graph
2 | init --from-graph --seconds 0 | argument --seconds: expected a number above 0, found 0
1 | init --from-bag none.mcap | none.mcap: no such file or folder
1 | init --from-bag {_LONG} | {_LONG}: cannot be read: File name too long
1 | init --from-bag rig.mcap -o mine.yaml | mine.yaml: already exists and is not overwritten
2 | export rig.mcap --config f.yaml | the following arguments are required: -o/--output
2 | export rig.mcap --config f.yaml -o new --fields /camera | --fields /camera: expected TOPIC:FIELD,FIELD
2 | export rig.mcap --config f.yaml -o new --fields /camra:x | /camra is no input of the file, did you mean `/camera`?
2 | export rig.mcap --config f.yaml -o new --group frnt | --group frnt: f.yaml has no such group, did you mean `front`?
2 | export rig.mcap --config f.yaml -o new --images jpg | --images jpg: expected png or jpeg, or TOPIC=png or TOPIC=jpeg
2 | export rig.mcap --config f.yaml -o new --images /camra=png | /camra is no input of the file, did you mean `/camera`?
2 | export rig.mcap --config f.yaml -o new --images png --images jpeg | --images jpeg: a format is named twice for all
2 | export rig.mcap --config f.yaml -o new --raw --images png | --raw keeps each message as it is
2 | export rig.mcap --config f.yaml -o new --format mcap --raw | --fields, --images and --raw are for tables: --format
2 | export rig.mcap --config f.yaml -o new --format lerobot --compression lz4 | --compression is for Parquet and MCAP
2 | replay rig.mcap --config f.yaml --compression none | --compression goes with --output
2 | observe --config a.yaml --config b.yaml --write new.yaml | --write goes with one --config FILE
2 | observe --config conf --write new.yaml | --write goes with one --config FILE: conf has 2
1 | observe --config f.yaml --write mine.yaml | mine.yaml: already exists and is not overwritten
1 | observe --config f.yaml --write there/new.yaml | there/new.yaml: cannot be written: there is not a folder
2 | top --json | --json goes with --once
2 | top --url ftp://robot | --url ftp://robot: expected a host, host:port or http://host:port
1 | top --once --url GONE | {_NOBODY}  A relay on another machine answers only if its file says
1 | tap --url GONE | {_NOBODY}  A relay on another machine answers only if its file says
1 | reload --url GONE | {_NOBODY}  If the relay's file says `metrics: null`, send SIGHUP to its process
2 | tap frnt --url URL | the relay has no group `frnt`, did you mean `front`?
2 | tap --input /nothing --url URL | the relay has no input `/nothing`
2 | tap --reason lat --url URL | argument --reason: invalid choice: 'lat'
2 | tap -n 0 --url URL | argument -n/--number: expected a whole number above 0, found 0
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("refusals")
    group = {
        "policy": "approximate_time",
        "slop": "5ms",
        "topics": inputs(dict.fromkeys(("/camera", "/lidar"), VECTOR)),
    }
    (made / "f.yaml").write_text(config({"front": group}))
    (made / "link.yaml").symlink_to("f.yaml")
    (made / "mine.yaml").write_text("mine")
    (made / "conf").mkdir()
    (made / "conf" / "front.yaml").write_text(GOOD)
    (made / "conf" / "node.yaml").write_text("version: 1\nnode: {name: rig}\n")
    write_mcap(made / "rig.mcap", rig())
    return made


@pytest.fixture(scope="module")
def urls():
    """Where a relay answers, and where nothing listens any more."""
    with running(states.healthy()) as gone:
        pass
    with running(states.healthy()) as server:
        yield server.url, gone.url


@pytest.mark.parametrize("row", _REFUSED.strip().splitlines())
def test_what_cannot_be_is_refused_in_a_sentence(row, folder, urls):
    row = row.replace("URL", urls[0]).replace("GONE", urls[1]).replace(r"\n", "\n")
    code, words, said = (part.strip() for part in row.split(" | "))
    before = sorted(folder.iterdir())
    given = shlex.split(words)
    # The relay and what is like it take signals and set up a log.
    has_process = given[0].startswith("-") or given[0] in ("demo", "observe")
    done = (run if has_process else run_here)(*given, folder=folder)
    assert (done.returncode, done.stdout) == (int(code), "")
    assert done.stderr.removeprefix("syncrelay: ").startswith(said)
    assert (sorted(folder.iterdir()), (folder / "mine.yaml").read_text()) == (before, "mine")


@pytest.mark.parametrize("command", ["", *COMMANDS])
def test_every_option_is_suggested_where_it_is_misspelt_and_refuses_what_it_does_not_take(command):
    make = COMMANDS[command].parser if command else relay.parser
    for action in make().actions:
        for option in (each for each in action.option_strings if each.startswith("--")):
            misspelt = f"{option[:3]}{option[2:]}"
            said: dict[tuple[str, ...], str] = {(misspelt,): f"unknown argument {misspelt}, did you mean `{option}`?"}
            if action.nargs != 0:
                said[option,] = f"argument {'/'.join(action.option_strings)}: expected one argument"
            if action.choices is not None:
                said[option, "nonsense"] = "invalid choice: 'nonsense'"
            elif action.type is not None:
                said[option, "nonsense"] = "expected a "
            for words, sentence in said.items():
                with pytest.raises(UsageError) as raised:
                    make().read([*example(command), *words])
                assert sentence in str(raised.value)
                assert f"\n  see syncrelay {command}".rstrip() in str(raised.value)
