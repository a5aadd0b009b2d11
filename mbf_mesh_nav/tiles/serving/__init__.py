"""A map of tiles behind the actions and questions of a server: its surroundings of a place, its overview, its check."""
