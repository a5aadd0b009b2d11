"""What a run leaves behind: recording, metrics, digest, verdict."""
