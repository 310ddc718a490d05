"""The pictures of reports (SVG)."""
