"""What the planners on a mesh share: segments, waves, corridors of faces, path costs."""
