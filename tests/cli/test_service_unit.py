"""configs/syncrelay.service: systemd takes it, and what it does not restart after is what a restart cannot mend."""

import configparser
import shlex
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.cli.command import run

_UNIT = Path(__file__).parents[2] / "configs" / "syncrelay.service"
_ANALYZE = shutil.which("systemd-analyze")


@pytest.fixture(scope="module")
def service():
    read = configparser.RawConfigParser(strict=False)
    read.optionxform = str  # type: ignore[assignment,method-assign]
    read.read(_UNIT)
    return read["Service"]


def test_an_error_of_the_file_or_of_the_words_ends_as_the_unit_expects(service, tmp_path):
    program, *words = shlex.split(service["ExecStart"])
    assert Path(program).name == "syncrelay"
    assert words == ["--config", "/etc/syncrelay/fusion.yaml"]
    (tmp_path / "fusion.yaml").write_text("version: 1\ngroups: {}\nnod: {}\n")
    codes = {
        run("--config", "fusion.yaml", folder=tmp_path).returncode,
        run("--confg", "x", folder=tmp_path).returncode,
    }
    assert set(service["RestartPreventExitStatus"].split()) == {*map(str, codes)}


@pytest.mark.skipif(_ANALYZE is None, reason="there is no systemd-analyze")
def test_systemd_takes_it(tmp_path):
    text = _UNIT.read_text().replace("/opt/syncrelay/bin/syncrelay", shutil.which("true") or "/bin/true")
    (tmp_path / "syncrelay.service").write_text(text.replace("User=robot", "User=root"))
    ran = subprocess.run(
        [str(_ANALYZE), "verify", "--man=no", str(tmp_path / "syncrelay.service")],
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )
    assert (ran.returncode, ran.stderr) == (0, "")
