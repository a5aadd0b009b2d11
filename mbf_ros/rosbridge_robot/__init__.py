"""Robots on the other side of a rosbridge: behind a server of their own, as clients of ours, or simulated."""
