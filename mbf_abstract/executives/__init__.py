"""Executives: who decides what the robot does next, built on the split actions. Import the module you need."""
