"""Hydra: what draws a stage by UsdImagingGL; without Qt.

engine    a stage, drawn by one of the installed render delegates into the framebuffer that is bound
"""
