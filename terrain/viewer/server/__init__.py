"""The server behind a live page, and who may use it."""
