"""Sets of recordings as record batches, read as they are asked for."""

from collections.abc import Iterator, Sequence
from contextlib import closing

import pyarrow as pa

from syncrelay.bag import open_recording
from syncrelay.bag.bindings import bind
from syncrelay.bag.replay import Replay
from syncrelay.config import Config, load
from syncrelay.config.wording import all_of, did_you_mean
from syncrelay.datasets.tables import Content, Fields, SetTable
from syncrelay.datasets.images import ImageFormat
from syncrelay.errors import UsageError
