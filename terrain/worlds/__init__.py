"""Worlds: generated and measured terrain, floor plans, buildings of several levels."""
