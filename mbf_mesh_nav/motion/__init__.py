"""What the controllers and the recoveries that move the robot share."""
