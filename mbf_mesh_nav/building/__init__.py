"""Maps from point clouds: readers, surfaces one above the other, holes, obstacles, map file, command."""
