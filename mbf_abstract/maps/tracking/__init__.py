"""Objects that move among what sensors see: who they are, where they will be, and when the robot would touch them."""
