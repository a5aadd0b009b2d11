"""What every navigation map has in common: queries, views, range measurements, relaxed tolerances."""
