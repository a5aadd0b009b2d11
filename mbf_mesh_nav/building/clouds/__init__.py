"""Point clouds on disk: PLY, PCD, LAS and LAZ, and tables of coordinates."""
