"""Shots built in code, as records."""
