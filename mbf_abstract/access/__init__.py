"""Who may reach a server on this machine, whatever it serves."""
