"""Trains on matched messages as they are read from recordings: no files between.

python3 train_on_sets.py fusion.yaml drive_1.mcap drive_2.mcap     (needs torch, and syncrelay[datasets])
"""

import sys

import torch
from torch.utils.data import DataLoader, IterableDataset, get_worker_info

from syncrelay.recordings.datasets import read_sets


class Sets(IterableDataset):
    """Angular velocity and acceleration of each set; each worker of a DataLoader reads recordings of its own."""

    def __init__(self, config, recordings, imu):
        self.config, self.recordings, self.imu = config, recordings, imu

    def __iter__(self):
        worker = get_worker_info()
        mine = self.recordings[worker.id :: worker.num_workers] if worker else self.recordings
        fields = {self.imu: ["angular_velocity", "linear_acceleration"]}
        for batch in read_sets(mine, self.config, fields=fields):
            for message in batch[self.imu].to_pylist():
                yield torch.tensor([each for vector in message.values() for each in vector.values()])


if __name__ == "__main__":
    config, *recordings = sys.argv[1:]
    for batch in DataLoader(Sets(config, recordings, "/imu/data"), batch_size=32, num_workers=2):
        print(tuple(batch.shape), batch.mean(0).tolist())
