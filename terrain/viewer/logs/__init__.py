"""Runs as logs for Foxglove (MCAP) and Rerun."""
