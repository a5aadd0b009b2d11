"""Recordings of ROS: a bag replayed through our transform buffer and layers, and a run written as a bag."""
