"""Configuration files: reading, validation with all findings at once, the registry of plugin types."""
