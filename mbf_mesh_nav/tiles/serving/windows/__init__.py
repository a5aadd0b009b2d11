"""The window around the robot: what it is cut out with, how it follows, and what drives on it."""
