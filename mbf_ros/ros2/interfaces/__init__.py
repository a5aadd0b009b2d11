"""Message packages that the wheels of ROS 2 lack: their definitions, and what compiles them."""
