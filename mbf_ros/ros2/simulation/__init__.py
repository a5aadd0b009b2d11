"""Simulated robots as nodes of ROS 2, for any navigation stack."""
