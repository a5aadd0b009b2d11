"""A native node of ROS 2: the navigator with the actions, services, topics and parameters of Move Base Flex."""
