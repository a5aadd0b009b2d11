"""Parts of the reference trees: their options, and what they do about who is in the way."""
