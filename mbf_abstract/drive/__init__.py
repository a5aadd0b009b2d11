"""From a controller's command to a robot: the robot protocol, the velocity gate and its limits."""
