"""HTML reports: pages, tables, timelines."""
