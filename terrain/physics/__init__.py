"""What moves in a world: PyBullet, wheeled and kinematic robots, actors, incidents."""
