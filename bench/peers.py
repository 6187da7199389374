"""Compare tools that cut datasets from recordings: `python bench/peers.py --help`; results: docs/explanation/peers.md.

Each is asked for every message of the first topic with the nearest one of the second; header stamps are the truth.
CPU is user and system time of the whole process, as a ratio to `syncrelay export` in the same round. VENVS holds a venv
by the name of each tool; one that is missing is left out. Beside what pip installs by itself, hephaes 0.3.0 needs
`pillow` and `pyarrow<20`, rosbags-dataframe `pyarrow`, forge-robotics its extra `mcap`.
"""

import argparse
import bisect
import json
import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
from peer_jobs import JOBS
from rosbags.highlevel import AnyReader

# What a process had before its exec counts as its own memory: start it from a small one.
METER = """import resource, subprocess, sys
code = subprocess.call(sys.argv[1:], stdout=sys.stderr)
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(used.ru_utime + used.ru_stime, used.ru_maxrss / 1024)
sys.exit(code)
"""


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("venvs", type=Path)
    parser.add_argument("recording")
    parser.add_argument("config", help="syncrelay's file")
    parser.add_argument("group", help="of the file, with both topics")
    parser.add_argument("topics", nargs=2, metavar="TOPIC[:FIELD,...]", help="with what to write of it (default: all)")
    parser.add_argument("--tolerance", type=int, default=50_000_000, help="of the others, in ns (default: %(default)s)")
    parser.add_argument("--offset", type=int, default=0, help="what to add to the second's stamps, in ns")
    parser.add_argument("--without", action="append", default=[], choices=JOBS, help="leave this tool out")
    parser.add_argument("--rounds", type=int, default=5)
    asked = parser.parse_args()
    topics = [(topic, fields.split(",")) for topic, _, fields in (word.partition(":") for word in asked.topics)]
    given = {"recording": asked.recording, "topics": topics, "tolerance": asked.tolerance, "offset": asked.offset}
    export = [sys.executable, "-m", "syncrelay", "export", asked.recording, "--config", asked.config, "--jobs", "1"]
    export += ["--group", asked.group, *(f"--fields={word}" for word in asked.topics if ":" in word)]
    pythons = {tool: asked.venvs / tool / "bin" / "python" for tool in JOBS if tool not in asked.without}
    tools = ["syncrelay", *(tool for tool, python in pythons.items() if python.exists())]
    spent: dict[str, list[tuple[float, float]]] = {tool: [] for tool in tools}
    found = {}
    for _ in range(asked.rounds):
        for tool in tools:
            with tempfile.TemporaryDirectory() as out:
                job = [Path(__file__).with_name("peer_jobs.py"), tool, json.dumps({**given, "out": out})]
                spent[tool].append(run([*export, "-o", out] if tool == "syncrelay" else [pythons[tool], *job]))
                found[tool] = pairs(Path(out), [topic for topic, _ in topics])
    first, second = (stamps_of(asked.recording, topic) for topic, _ in topics)
    for tool, runs in spent.items():
        ratio = statistics.median(cpu / base for (cpu, _), (base, _) in zip(runs, spent["syncrelay"], strict=True))
        cpu, memory = (statistics.median(column) for column in zip(*runs, strict=True))
        print(
            f"{tool}: {cpu:.2f} s of CPU, ratio {ratio:.2f}, {memory:.0f} MB,",
            judge(found[tool], first, second, asked.offset),
        )


def run(command):
    """Return the CPU in seconds and the memory in MB that a command took; raise RuntimeError if it failed."""
    with tempfile.TemporaryFile() as said:
        done = subprocess.run([sys.executable, "-c", METER, *command], stdout=subprocess.PIPE, stderr=said, check=False)
        if done.returncode:
            raise RuntimeError(os.pread(said.fileno(), 10_000, 0).decode())
    return tuple(map(float, done.stdout.split()))


def pairs(out, topics):
    """Return the header stamps that a tool put in each row, of the first topic and the second."""
    if (out / "pairs.json").exists():
        return json.loads((out / "pairs.json").read_text())
    (table,) = (pq.ParquetFile(path) for path in out.rglob("*.parquet"))
    if "stamps" in table.schema_arrow.names:
        stamps = table.read(["stamps"]).flatten()
        columns = [stamps[f"stamps.{topic}"].cast(pa.int64()).to_pylist() for topic in topics]
        return [list(row) for row in zip(*columns, strict=True)]
    if "header.stamp.sec" in table.schema_arrow.names:
        keys = [f"header.stamp.{part}{side}" for side in ("", " b") for part in ("sec", "nanosec")]
        rows = (list(row.values()) for row in table.read(keys).to_pylist())
        return [[ns(*row[:2]), ns(*row[2:])] for row in rows]
    names = [next(name for name in table.schema_arrow.names if name in (f"{s} ", f"{s} header")) for s in "ab"]
    sides = [[json.loads(value) for value in row.values()] for row in table.read(names).to_pylist()]
    return [[ns(**side.get("header", side)["stamp"]) for side in row] for row in sides]


def ns(sec, nanosec, **_):
    return int(sec) * 10**9 + int(nanosec)


def stamp_in(message):
    return message.header.stamp


def stamps_of(recording, topic):
    with AnyReader([Path(recording)]) as reader:
        read = reader.messages(reader.topics[topic].connections)
        stamps = (stamp_in(reader.deserialize(content, of.msgtype)) for of, _, content in read)
        return sorted(ns(stamp.sec, stamp.nanosec) for stamp in stamps)


def judge(rows, first, second, offset):
    """Tell how many rows have the nearest partner, and by how much the others miss it."""
    missed = []
    for a, b in rows:
        at = bisect.bisect_left(second, a - offset)
        best = min(abs(near + offset - a) for near in second[max(0, at - 1) : at + 1])
        missed.append(abs(b + offset - a) - best)
    worse = [by for by in missed if by] or [0]
    again = len(rows) - len({b for _, b in rows})
    return (
        f"{len(rows)} rows of {len(first)}, {sum(map(bool, missed))} not with the nearest: by "
        f"{statistics.median(worse) / 1e6:.1f} ms, at most {max(worse) / 1e6:.1f}; {again} partners used again"
    )


if __name__ == "__main__":
    main()
