"""Robots of scenarios that somebody outside drives, such as a navigation stack on ROS 2."""
