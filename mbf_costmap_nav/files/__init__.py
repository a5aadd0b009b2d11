"""Maps on disk in the format of map_server."""
