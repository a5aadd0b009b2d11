"""The server of a page, and the guard between it and its visitors."""
