"""The server of a page, and its access control."""
