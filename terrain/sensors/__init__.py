"""Simulated sensors: lidar, proprioception and the rays that they cast."""
