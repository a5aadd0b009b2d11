"""What the grid planners share."""
