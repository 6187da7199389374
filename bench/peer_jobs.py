"""The jobs of bench/peers.py, written for each tool as its users would; each runs in a venv with that tool."""

# ruff: noqa: PLC0415  each venv has one of the tools

import json
import sys
from pathlib import Path
from types import SimpleNamespace


def hephaes(job):
    """Join the second topic to the first by receive time, the only one that it knows, and write Parquet."""
    from hephaes import Converter
    from hephaes.models import AssemblySpec, ConversionSpec, FeatureSpec, FieldSourceSpec, JoinSpec, OutputSpec

    features = {}
    for side, (topic, fields) in zip("ab", job.topics, strict=True):
        for field in fields:
            source = FieldSourceSpec(topic=topic, field_path=field or None)
            features[f"{side} {field}"] = FeatureSpec(source=source, dtype="bytes" if field == "data" else "json")
    (first, _), (second, _) = job.topics
    joins = [JoinSpec(topic=second, sync_policy="nearest", tolerance_ns=job.tolerance)]
    rows = AssemblySpec(trigger_topic=first, joins=joins)
    spec = ConversionSpec(row_strategy=rows, features=features, output=OutputSpec(format="parquet"))
    Converter([job.recording], None, job.out, spec=spec, max_workers=1).convert()


def rosbags_dataframe(job):
    """Join two dataframes by header stamps with pandas: matching is the user's own."""
    import pandas as pd
    from rosbags.dataframe import get_dataframe
    from rosbags.highlevel import AnyReader
    from rosbags.interfaces import Nodetype

    def leaves(type_name, under=""):
        for name, (kind, detail) in reader.typestore.get_msgdef(type_name).fields:
            yield from leaves(detail, under + name + ".") if kind == Nodetype.NAME else [under + name]

    def stamped(topic, fields, move):
        keys = [key for key in leaves(reader.topics[topic].msgtype) if key.startswith(tuple(fields))]
        frame = get_dataframe(reader, topic, keys)
        frame["at"] = frame["header.stamp.sec"] * 10**9 + frame["header.stamp.nanosec"] + move
        return frame.sort_values("at")

    with AnyReader([Path(job.recording)]) as reader:
        a, b = (stamped(topic, fields, move) for (topic, fields), move in zip(job.topics, (0, job.offset), strict=True))
    rows = pd.merge_asof(a, b, on="at", direction="nearest", tolerance=job.tolerance, suffixes=("", " b"))
    rows.dropna(subset="header.stamp.sec b").to_parquet(Path(job.out, "rows.parquet"))


def forge_robotics(job):
    """Read frames with its own reader, headers only: `forge convert` does not pass on which topics to match."""
    from forge.formats.mcap.reader import MCAPReader
    from forge.formats.mcap.topic_config import FieldMapping, SyncPolicy, TopicConfig

    fields = {side: FieldMapping(topic, field="header") for side, (topic, _) in zip("ab", job.topics, strict=True)}
    policy = SyncPolicy(primary="a", method="nearest", max_skew_ms=job.tolerance / 1e6)
    episodes = MCAPReader().read_episodes(Path(job.recording), TopicConfig(fields=fields, sync=policy))
    stamps = [[frame.extras[side].stamp for side in "ab"] for episode in episodes for frame in episode.frames()]
    pairs = [[stamp.sec * 10**9 + stamp.nanosec for stamp in row] for row in stamps]
    Path(job.out, "pairs.json").write_text(json.dumps(pairs))


JOBS = {"hephaes": hephaes, "rosbags-dataframe": rosbags_dataframe, "forge-robotics": forge_robotics}

if __name__ == "__main__":
    JOBS[sys.argv[1]](SimpleNamespace(**json.loads(sys.argv[2])))
