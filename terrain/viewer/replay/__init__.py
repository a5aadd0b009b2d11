"""The replay of a run: one HTML file that draws itself in any browser, without network and without Python."""
