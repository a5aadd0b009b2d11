"""The commands of ``mbf`` that need a simulator."""
