"""The skeleton: commands, their help, usage errors and exit codes."""

import shlex
import sys

import pytest

from syncrelay.cli.boundary import guarded
from syncrelay.cli.commands import COMMANDS
from syncrelay.cli.stop import Terminated
from syncrelay.errors import RosUnavailableError, SyncRelayError, TypeImportError, UsageError
from tests.cli.command import BAD, GOOD, run, run_here, run_python


def test_help_is_the_same_however_it_is_asked_for_and_goes_to_stdout(tmp_path):
    done = run("--help", folder=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert "130 interrupted, 143 ended by SIGTERM" in " ".join(done.stdout.split())
    assert run("help", folder=tmp_path).stdout == run("-h", folder=tmp_path).stdout == done.stdout


def test_the_first_help_names_what_most_need_by_what_it_is_for_and_the_whole_one_all(tmp_path):
    first, whole = run("--help", folder=tmp_path).stdout, run("--help", "--all", folder=tmp_path).stdout
    assert whole == run("help", "--all", folder=tmp_path).stdout == run("--all", "-h", folder=tmp_path).stdout
    named = {command: f"\n  {command} " in first for command in COMMANDS}
    assert [command for command, is_first in named.items() if not is_first and f"\n  {command} " not in whole] == []
    for use, commands in {
        "a file": ("validate", "diff", "graph", "test"),
        "recordings": ("init", "analyze", "replay", "export"),
        "a robot": ("doctor", "observe", "top", "tap", "reload"),
    }.items():
        below = first.split(f"\nfor {use}:\n")[1].split("\n")
        assert [line.split()[0] for line in below[: len(commands)]] == [*commands]
    assert not any(named[command] for command in ("demo", "schema", "completion", "healthcheck"))
    alone = run("--all", folder=tmp_path)
    assert (alone.returncode, alone.stderr.split("\n")[0]) == (2, "syncrelay: --all goes with --help")


@pytest.mark.parametrize("command", ["", *COMMANDS])
def test_the_help_of_a_command_fits_a_screen(command, tmp_path):
    done = run_here(*filter(None, [command]), "--help", folder=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith(f"usage: syncrelay {command}".rstrip())
    lines = done.stdout.splitlines()
    assert max(map(len, lines)) <= 80
    # The relay's has a line for each command, and some have the options of many recordings.
    assert len(lines) <= 24 + 25 * (command in {"", "export", "fleet", "replay", "tap"})


def test_without_a_word_it_says_how_on_stderr(tmp_path):
    done = run(folder=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("usage: syncrelay --config FILE")


def test_the_version_is_that_of_the_package(tmp_path):
    done = run("--version", folder=tmp_path)
    assert done.returncode == 0
    assert done.stdout.startswith("syncrelay ")


def test_the_relay_shows_the_faults_of_its_file_as_validate_does(tmp_path):
    (tmp_path / "f.yaml").write_text(BAD)
    relayed = run("--config", "f.yaml", folder=tmp_path)
    assert (relayed.returncode, relayed.stdout) == (1, "")
    assert relayed.stderr == run("validate", "f.yaml", folder=tmp_path).stderr


@pytest.mark.parametrize("name", ["drive.mcap", "a drive.db3.zstd", "old.bag", "rosbag2_day"])
def test_a_recording_where_it_does_not_belong_is_told_which_commands_are_meant(name, tmp_path):
    (tmp_path / "rosbag2_day").mkdir()
    (tmp_path / "rosbag2_day" / "metadata.yaml").write_text("rosbag2_bagfile_information:\n")
    for each in ("drive.mcap", "a drive.db3.zstd", "old.bag", "rosbag2_day/drive_0.mcap"):
        (tmp_path / each).write_bytes(b"")
    (tmp_path / "f.yaml").write_text(GOOD)
    tried = [[name], ["init", name], ["replay", name], ["export", name], ["--config", name], ["diff", "f.yaml", name]]
    tried += [[command, name] for command in ("validate", "graph", "test")]
    tried += [[command, "--config", name] for command in ("doctor", "observe")]
    tried += [[command, name, "--config", name] for command in ("analyze", "replay", "export")]
    for words in tried:
        done = run_here(*words, folder=tmp_path)
        assert (done.returncode, done.stdout) == (2, ""), words
        meant = [line.split("   ")[0] for line in done.stderr.splitlines() if line.startswith("  syncrelay ")]
        assert len(meant) == 4, done.stderr
        for line in meant:
            command, *rest = shlex.split(line)[1:]
            assert name in rest
            COMMANDS[command].parser().read(rest)


def test_a_folder_of_files_beside_a_recording_is_one_of_files(tmp_path):
    (tmp_path / "drive.mcap").write_bytes(b"")
    (tmp_path / "f.yaml").write_text(GOOD)
    assert run_here("validate", ".", folder=tmp_path).returncode == 0


@pytest.mark.parametrize(
    ("raised", "code", "said"),
    [
        (SyncRelayError("it is so"), 1, "syncrelay: it is so\n"),
        (TypeImportError("it is so"), 1, "syncrelay: it is so\n"),
        (UsageError("it is so"), 2, "syncrelay: it is so\n"),
        (RosUnavailableError("it is so"), 69, "syncrelay: it is so\n"),
        (KeyboardInterrupt(), 130, ""),
        (Terminated(), 143, ""),
    ],
)
def test_every_error_has_its_exit_code(raised, code, said, capsys):
    def command():
        raise raised

    assert guarded(command) == code
    assert capsys.readouterr() == ("", said)


def test_a_bug_of_ours_shows_its_traceback_and_asks_for_a_report(capsys):
    assert guarded(lambda: 1 // 0) == 70
    printed, said = capsys.readouterr()
    assert (printed, said.startswith("Traceback (most recent call last):")) == ("", True)
    assert "ZeroDivisionError" in said
    assert "this is a bug in syncrelay, please report it" in said.splitlines()[-1]


@pytest.mark.parametrize("words", [["schema"], ["--help"], ["validate", "-"]])
def test_a_reader_that_goes_away_is_no_bug(words, tmp_path):
    # The pipe's other end is closed before anything is written.
    script = (
        "import os, sys; from syncrelay.cli import main; read, write = os.pipe(); os.close(read); os.dup2(write, 1);"
        "sys.exit(main(sys.argv[1:]))"
    )
    done = run_python("-c", script, *words, folder=tmp_path, stdin=GOOD)
    assert (done.returncode, done.stderr) == (1, "")


@pytest.mark.parametrize("streams", [">&-", "2>&-", "<&-", "<&- >&- 2>&-"])
def test_a_stream_that_is_closed_is_as_good_as_none(streams, tmp_path):
    (tmp_path / "good.yaml").write_text(GOOD)
    script = "import os, sys; sys.exit(os.waitstatus_to_exitcode(os.system(sys.argv[1])))"
    words = f"{shlex.quote(sys.executable)} -m syncrelay validate good.yaml {streams}"
    done = run_python("-c", script, words, folder=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")


def test_a_full_disk_is_no_bug(tmp_path):
    script = (
        "import os, sys; from syncrelay.cli import main; os.dup2(os.open('/dev/full', os.O_WRONLY), 1);"
        "sys.exit(main(['schema']))"
    )
    done = run_python("-c", script, folder=tmp_path)
    assert done.returncode == 1
    assert done.stderr == "syncrelay: standard output cannot be written: No space left on device\n"


def test_the_signals_of_the_relay_are_taken_before_anything_slow_is_imported(tmp_path):
    script = (
        "import signal, sys\n"
        "before = set(sys.modules)\n"
        "seen = []\n"
        "installed = signal.signal\n"
        "def signal_seen(number, action):\n"
        "    seen.append(sorted({name.partition('.')[0] for name in set(sys.modules) - before}))\n"
        "    return installed(number, action)\n"
        "signal.signal = signal_seen\n"
        "from syncrelay.cli import main\n"
        "main(['--config', 'missing.yaml'])\n"
        "print(*seen[0])\n"
    )
    done = run_python("-c", script, folder=tmp_path)
    assert set(done.stdout.split()) <= {"syncrelay", "collections"}
