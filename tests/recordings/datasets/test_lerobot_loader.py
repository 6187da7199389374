"""A dataset as lerobot's own loader reads it: `make test-lerobot` installs that."""

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from tests.recordings.datasets.drives import INPUTS, config, drive, picture, task, written

pytest.importorskip("lerobot")
# What others warn of is theirs.
pytestmark = pytest.mark.filterwarnings("ignore")

FRONT, WRIST = "observation.images.front", "observation.images.wrist"
FIRST, SECOND = range(0, 2000, 100), range(50, 950, 100)
STAMPS = [*FIRST, *SECOND]


@pytest.fixture(scope="module")
def root(tmp_path_factory) -> Path:
    """A dataset of two episodes."""
    folder = tmp_path_factory.mktemp("lerobot")
    bags = [drive(folder / "a.mcap", FIRST), drive(folder / "b.mcap", SECOND)]
    written(folder, *bags)
    return folder / "dataset"


@pytest.fixture
def load(root, monkeypatch, tmp_path):
    """What opens the dataset, or another, with no hub to ask."""
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    monkeypatch.setenv("HF_DATASETS_CACHE", str(tmp_path / "cache"))
    from lerobot.datasets import LeRobotDataset  # noqa: PLC0415  as above

    def opened(folder=root, **options):
        # torchcodec needs FFmpeg's libraries on the machine; PyAV brings its own.
        return LeRobotDataset("syncrelay/test", root=folder, video_backend="pyav", **options)

    return opened


def shown(tensor) -> np.ndarray:
    """Pixels [height, width, RGB] from 0 to 255."""
    return tensor.numpy().transpose(1, 2, 0) * 255


def test_every_item_has_the_values_and_pictures_of_its_messages(load):
    dataset = load()
    for number, stamp in enumerate(STAMPS):
        item = dataset[number]
        state = [stamp / 1000, stamp / 1000 + 1, stamp / 1000 + 2, -stamp / 7]
        assert item["observation.state"].numpy() == pytest.approx(np.array(state, np.float32))
        assert item["action"].numpy() == pytest.approx(np.array([stamp / 100, -1, 0.5], np.float32))
        assert np.abs(shown(item[FRONT]) - picture(stamp)).mean() < 2.5
        assert np.abs(shown(item[WRIST]) - picture(stamp + 350)).mean() < 2.5
        assert (item["task"], item["episode_index"].item()) == ("pick up the cube", int(number >= 20))


def test_windows_of_time_reach_to_the_ends_of_an_episode(load):
    dataset = load(delta_timestamps={FRONT: [-0.2, -0.1, 0.0], "action": [0.0, 0.1, 0.2]})
    item = dataset[21]
    assert [action[0].item() for action in item["action"]] == pytest.approx([1.5, 2.5, 3.5])
    for pixels, stamp in zip(item[FRONT], (50, 50, 150), strict=True):
        assert np.abs(shown(pixels) - picture(stamp)).mean() < 2.5
    assert item[f"{FRONT}_is_pad"].tolist() == [True, False, False]
    last = dataset[19]
    assert last["action_is_pad"].tolist() == [False, True, True]
    assert [action[0].item() for action in last["action"]] == pytest.approx([19, 19, 19])


def test_single_values_single_frames_and_tasks_of_a_topic_are_read(load, tmp_path):
    inputs = INPUTS + "      - {topic: /task, type: std_msgs/msg/String, stamp: receive}\n"
    features = "\n      action: /cmd:twist.linear.x\n      observation.state: [/joints:position]\n"
    loaded = config(
        inputs=inputs,
        features=features,
        group="latest_time\n    trigger: /camera",
        more="task: {topic: /task, field: data}",
    )
    topics = ("/task", "/wrist", "/joints", "/cmd", "/camera")
    words = {("/task", stamp): task(stamp, words="close it") for stamp in range(300, 900, 100)}
    bags = [
        drive(tmp_path / "one.mcap", [0, 1], topics=topics),
        drive(tmp_path / "many.mcap", range(0, 900, 100), topics=topics, instead=words),
    ]
    written(tmp_path, *bags, loaded=loaded)
    dataset = load(tmp_path / "dataset")
    lengths = [each["length"] for each in dataset.meta.episodes]
    assert lengths[0] == 1
    assert len(dataset) == sum(lengths)
    assert [dataset[place]["task"] for place in (0, len(dataset) - 1)] == ["open the door", "close it"]
    assert dataset[len(dataset) - 1]["action"].shape in ((), (1,))
    assert dataset.meta.stats["action"]["mean"].shape == (1,)
    assert len(load(tmp_path / "dataset", delta_timestamps={"action": [0.0, 0.1]})[0]["action"]) == 2


def test_its_statistics_are_those_that_lerobot_computes(load, root):
    from lerobot.datasets.compute_stats import aggregate_stats, compute_episode_stats  # noqa: PLC0415  as above

    dataset = load()
    rows = pq.read_table(root / "data/chunk-000/file-000.parquet")
    names = ("observation.state", "action", "timestamp", "frame_index", "index", "task_index")
    parts = [compute_episode_stats(_columns(part, names), dataset.features) for part in (rows[:20], rows[20:])]
    expected = aggregate_stats(parts)
    for name in names:
        span = np.maximum(np.array(expected[name]["max"]) - expected[name]["min"], 1)
        for what, each in expected[name].items():
            assert dataset.meta.stats[name].keys() == expected[name].keys()
            assert dataset.meta.stats[name][what].shape == each.shape, (name, what)
            # Its quantiles are of a histogram, of few frames.
            off = np.abs(dataset.meta.stats[name][what] - each) / span
            assert off.max() < (0.12 if what.startswith("q") else 1e-5), (name, what)
    assert dataset.meta.stats[FRONT]["mean"].shape == (3, 1, 1)


def test_it_goes_together_with_another_by_lerobots_own_tools(load, tmp_path):
    from lerobot.datasets.dataset_tools import merge_datasets  # noqa: PLC0415  as above

    merged = merge_datasets([load(), load()], "syncrelay/merged", tmp_path / "merged")
    assert (len(merged), merged.num_episodes) == (58, 4)
    table = pa.concat_tables(pq.read_table(path) for path in sorted((tmp_path / "merged/data").rglob("*.parquet")))
    assert table["index"].to_pylist() == list(range(58))


def _columns(table: pa.Table, names) -> dict[str, np.ndarray]:
    return {name: np.array(table[name].to_pylist()) for name in names}
