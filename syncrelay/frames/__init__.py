"""Coordinate frames: which transforms are known at which times, as tf2 has it, without their geometry."""

from syncrelay.frames.buffer import Edge, Frames
from syncrelay.frames.tf_message import TF_TYPE, read_frame, read_ros1_frame, read_transforms

__all__ = ["TF_TYPE", "Edge", "Frames", "read_frame", "read_ros1_frame", "read_transforms"]
