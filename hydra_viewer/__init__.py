"""The desktop application for artists, on the public names of `usdslf`.

hydra_viewer.model   what is worked on, without Qt: document, undo, autosave, brush, cameras, display
hydra_viewer.hydra   the engine of the Hydra viewport, by UsdImagingGL
hydra_viewer.usdview the plugin that opens the painting window from usdview
hydra_viewer.ui      Qt: window, panels, viewports, the workers that step long work
"""
