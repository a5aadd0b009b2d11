"""Seeing a run: picture, replay and report, made from a ``Recording``; they need the extra ``sim``."""
