"""Planners on a costmap, one a file; the shared parts are in ``mbf_costmap_nav.planning.grid_planning`` and ``search_grid``."""
