"""ROS: messages as dictionaries, and a rosbridge server. Imports ``mbf_abstract`` only, and no package of ROS."""
