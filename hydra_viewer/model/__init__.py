"""What is worked on, without Qt.

document    one owner of shot, strokes, what was found, and files
history     undo and redo
autosave    strokes are on the disk after each change, and come back after a crash
brush       what the next stroke is painted with
orbit       cameras that a mouse moves
display     scene-linear pixels as code values of the screen
"""
