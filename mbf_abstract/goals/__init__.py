"""Goals and results of the actions, the handle of a running goal, goal areas, callbacks."""
