"""A rosbridge server: topics, services and actions for clients of the rosbridge protocol, version 2, as JSON."""
