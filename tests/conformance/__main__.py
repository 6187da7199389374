"""Prints what each script shows on the simulated ROS: `python -m tests.conformance > tests/conformance/seen.txt`.

Read what has changed before you keep it: it is what a user sees of the relay.
"""

import sys
import tempfile
from pathlib import Path

from tests.conformance.player import play
from tests.conformance.scripts import SCRIPTS
from tests.conformance.seen import told
from tests.conformance.simulated import SimulatedWorld

texts = []
for script in SCRIPTS:
    with tempfile.TemporaryDirectory() as folder, SimulatedWorld(1) as world:
        texts.append(told(script.title, play(script, world, Path(folder)), script.blind))
sys.stdout.write("\n\n".join(texts) + "\n")
