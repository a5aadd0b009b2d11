"""Cells and footprints: a costmap as an array, outlines, collision checks, masks and zones."""
