"""Recovery behaviours on costmaps, one a file; those that move share ``mbf_costmap_nav.control.guarded_motion``."""
