"""The actions: one file each, readable as the steps of one goal."""
