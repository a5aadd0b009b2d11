"""Planners on a costmap, one a file; what they share is in ``mbf_costmap_nav.planning``."""
