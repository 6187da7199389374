"""Reads the matched sets of recordings as tables, and tells how far apart their messages are.

python3 read_recording.py fusion.yaml drive_1.mcap drive_2.mcap     (needs syncrelay[datasets], no ROS)
"""

import sys

import pyarrow.compute as pc

from syncrelay.recordings.datasets import read_sets

config, *recordings = sys.argv[1:]
for batch in read_sets(recordings, config):
    spans = batch["span_ns"]
    topics = [field.name for field in batch.schema.field("stamps").type]
    print(f"{batch.num_rows} sets of {', '.join(topics)}: {pc.mean(spans).as_py() / 1e6:.2f} ms apart on average,")
    print(f"at most {pc.max(spans).as_py() / 1e6:.2f} ms; the last from {batch['recording'][-1].as_py()}")
