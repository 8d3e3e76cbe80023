"""Qt: window, panels, viewports, and the workers that step long work.

viewport    the interface of whatever shows the picture
viewports   the kinds that can be used here, and their menu: the live picture, Hydra by each render delegate
canvas      a viewport with strokes and the brush over it; takes mouse, pen and keys
words       all text that is shown
"""
