"""Recordings in and out: rosbag2 (sqlite3, MCAP) and ROS 1 bags. What is only carried is never decoded."""

from syncrelay.recordings.bag.listing import is_recording
from syncrelay.recordings.bag.opening import open_recording
from syncrelay.recordings.bag.recording import Channel, Encoding, RawMessage, Recording
from syncrelay.recordings.bag.storage import is_url

__all__ = ["Channel", "Encoding", "RawMessage", "Recording", "is_recording", "is_url", "open_recording"]
