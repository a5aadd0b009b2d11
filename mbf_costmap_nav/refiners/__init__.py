"""Path refiners on a costmap."""
