"""The layers of a costmap, one a file; ``costmap_config.BUILTIN_LAYERS`` names their types."""
