"""The layers of a costmap, one a file; ``BUILTIN_LAYERS`` names them for configurations."""
