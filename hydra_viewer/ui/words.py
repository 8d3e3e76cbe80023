"""All text that the viewer shows, in one place, so that it can be translated."""

from __future__ import annotations

TITLE = "usdslf"
PROGRAM = "Paint on a lit shot how a surface should look."
NO_SHOT = "No shot is open"

# Menus and actions: name, and what its tooltip adds.
FILE, EDIT, VIEW, CAMERA, PAINT, HELP = "&File", "&Edit", "&View", "&Camera", "&Paint", "&Help"
OPEN = ("&Open shot …", "Open a USD stage; it is never written to")
OPEN_STROKES = ("Open &strokes …", "Put the strokes of a stroke layer on the shot")
SAVE = ("&Save", "Write the strokes and the look layer")
SAVE_AS = ("Save &as …", "Write the strokes and the look to other files")
QUIT = ("&Quit", "Leave; what is not saved is asked about")
UNDO, REDO = ("&Undo", "Take the last change of strokes back"), ("&Redo", "Make it again")
CANCEL = ("&Cancel work", "Stop what is being computed; nothing is changed")
SOLVE = ("So&lve again", "Find anew what the strokes ask for")
FRAME = ("&Frame selected", "Look at what is selected, or at everything")

USD_FILES = "USD (*.usd *.usda *.usdc *.usdz)"
READY = "Ready"
BY_STEP = {
    "read": "Reading the shot",
    "elements": "Placing elements",
    "visibility": "Tracing visibility",
    "light": "Gathering light",
    "light field": "Sending light round",
    "evidence": "Looking at the strokes",
    "solve": "Finding the change",
    "author": "Writing the look",
    "render": "Making the picture",
}


def working(step: str, share: float) -> str:
    """Returns what is being done, and how much of it is done."""
    return f"{BY_STEP.get(step, step)} … {100 * share:.0f} %"


def tooltip(name: str, more: str, shortcut: str) -> str:
    """Returns what a tooltip says of an action."""
    plain = name.replace("&", "").replace(" …", "")
    head = f"{plain}  ({shortcut})" if shortcut else plain
    return f"{head}\n{more}" if more else head


def internal(error: BaseException) -> str:
    """Returns what is said of an error that is the program's own, as the command line says it."""
    return f"internal error: {type(error).__name__}: {error}"


def painted(tool: str) -> str:
    """Returns the name of the step of undo that a stroke is."""
    return f"{tool} stroke"


LIVE_VIEWPORT = "Built-in picture"
VIEWPORT, VIEWPORT_TIP = "&Viewport", "Show the shot by this renderer; camera, display and look stay"
HYDRA = "Hydra"
NO_OPENGL = "no OpenGL 4 context can be made here, which Hydra needs: use the built-in viewport"


def hydra_viewport(delegate: str) -> str:
    """Returns the name of the viewport that draws by a render delegate of Hydra."""
    return f"{HYDRA}: {delegate}"


def no_hydra(pxr: str, error: ImportError) -> str:
    """Returns why Hydra cannot be used although it is installed."""
    return f"{pxr} cannot be loaded ({error}): the built-in viewport is used"


CLOSE_BAR = "Close"
CANCEL_BUTTON = "Cancel"
STAGE_PANEL, BRUSH_PANEL, FOUND_PANEL = "Stage", "Brush", "Understood"
CHOOSE_STROKES, CHOOSE_LOOK = "Where the strokes go", "Where the look goes"
