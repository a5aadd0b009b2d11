"""The mesh map that a server runs: layers in order, snapshots, queries."""
