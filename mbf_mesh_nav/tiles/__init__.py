"""Maps larger than memory: a folder of tiles, the portals between them, and plans that load only what they need."""
