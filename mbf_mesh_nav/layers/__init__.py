"""The layers that come with the mesh server, one in each module."""
