"""Planners on a costmap, one a file; the shared parts are in ``mbf_costmap_nav.grid_planning`` and ``search_grid``."""
