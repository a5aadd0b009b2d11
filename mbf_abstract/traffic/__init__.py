"""What robots that run this navigation announce to each other, and who of two goes first."""
