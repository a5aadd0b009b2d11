"""What a URDF says of a robot: its wheels, outline, masses, and the slopes and edges it can stand on; no simulator."""
