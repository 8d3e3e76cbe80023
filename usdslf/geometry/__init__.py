"""Polygons to triangles."""
