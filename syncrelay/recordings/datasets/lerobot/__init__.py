"""Recordings as a LeRobotDataset v3.0: episodes of a fixed rate, with videos. See docs/howto/lerobot.md.

`write_episode` is what is done to each recording, and `join_episodes` what is done once they are there.
"""

from syncrelay.recordings.datasets.lerobot.dataset import join_episodes
from syncrelay.recordings.datasets.lerobot.episode import lerobot_of, write_episode

__all__ = ["join_episodes", "lerobot_of", "write_episode"]
