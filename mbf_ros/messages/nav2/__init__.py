"""The actions and services of Nav2 as messages, and their error codes."""
