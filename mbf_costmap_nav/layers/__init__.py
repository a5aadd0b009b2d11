"""The layers of a costmap, one a file; entry points of the group ``mbf.costmap_layers`` name their types."""
