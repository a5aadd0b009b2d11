"""What robots that run this navigation announce to each other, and which of two goes first."""
