"""Recordings as a LeRobotDataset v3.0: episodes of a fixed rate, with videos. See docs/howto/lerobot.md.

`write_lerobot` does it all. In a fleet, `write_episode` is what is done to each recording, and `join_episodes` what is
done once they are there.
"""

from syncrelay.recordings.datasets.lerobot.dataset import NamedRecording, join_episodes, write_lerobot
from syncrelay.recordings.datasets.lerobot.episode import lerobot_of, write_episode

__all__ = ["NamedRecording", "join_episodes", "lerobot_of", "write_episode", "write_lerobot"]
