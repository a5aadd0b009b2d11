"""The core of map-independent navigation: actions, executions, plugin interfaces. It knows no map."""
