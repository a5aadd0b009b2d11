"""Goals, results, questions and sensor data as ROS messages: dictionaries by field name, made by pure functions."""
