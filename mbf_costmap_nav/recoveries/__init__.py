"""Recovery behaviours that are a matter of the costmap; the others stand in ``mbf_abstract.maps.recoveries``."""
