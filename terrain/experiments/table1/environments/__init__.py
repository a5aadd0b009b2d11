"""Where the experiment takes place: a warehouse without physics, a Husky on rough ground."""
