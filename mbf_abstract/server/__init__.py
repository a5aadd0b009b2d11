"""The abstract navigation server, the plugins it hosts, and its factory."""
