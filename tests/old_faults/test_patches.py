"""The patches of old faults: they fit the sources as they are, so that `python -m tests.old_faults` can try them."""

import re
import shutil
import subprocess

import pytest

from tests.old_faults.__main__ import APPLY, PATCHES, ROOT


@pytest.mark.skipif(shutil.which("git") is None, reason="git is not installed")
def test_every_patch_applies():
    words = (*APPLY, "--check")
    done = [subprocess.run((*words, str(each)), cwd=ROOT, capture_output=True, check=False) for each in PATCHES]
    assert not [each.stderr.decode() for each in done if each.returncode]
    assert len(PATCHES) >= 25


@pytest.mark.parametrize("patch", PATCHES, ids=lambda patch: patch.stem)
def test_every_patch_says_what_a_user_saw_and_which_commit_holds_it_off(patch):
    saw, mended, *_ = patch.read_text().splitlines()
    assert re.fullmatch(r"# .+\.", saw)
    assert re.fullmatch(r"# (Mended by|Guarded against since) [0-9a-f]{8} \(.+\)\.", mended)
