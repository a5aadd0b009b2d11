"""Executions: the threads and loops that run plugins under patience, retries and cancel."""
