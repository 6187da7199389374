"""A simulated rig: camera, lidar and IMU as processes of their own, with the faults that real ones have."""
