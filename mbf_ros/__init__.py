"""ROS: messages as dictionaries, a node of ROS 2, rosbridge on both sides, and bags.

Imports ``mbf_abstract`` only; packages of ROS are imported by what makes a node, and only then.
"""
