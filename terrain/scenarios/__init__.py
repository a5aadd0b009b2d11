"""Scenarios: their schema and how a world is made from them; those that ship are in ``library``."""
