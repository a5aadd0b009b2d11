"""The commands of ``mbf`` that need no simulator, one module each; ``register`` puts a command on the application."""
