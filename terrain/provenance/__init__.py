"""What a run was made of, kept in its folder, and its repetition from that folder alone."""
