"""All text that the viewer shows, in one place, so that it can be translated."""

from __future__ import annotations

TITLE = "usdslf"
PROGRAM = "Paint on a lit shot how a surface should look."
NO_SHOT = "No shot is open"

# Menus and actions: name, and what its tooltip adds.
FILE, EDIT, VIEW, CAMERA, PAINT, HELP = "&File", "&Edit", "&View", "&Camera", "&Paint", "&Help"
OPEN = ("&Open shot …", "Open a USD stage; it is never written to")
OPEN_STROKES = ("Open &strokes …", "Put the strokes of a stroke layer on the shot")
RELOAD_SHOT = ("&Reload", "Read the shot anew from the disk; strokes stay")
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
    "similarity": "Comparing surfaces",
    "review": "Reviewing the look",
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


USDVIEW_PAINT = ("Paint how it should look …", "Open usdslf's painting window on this stage, frame and camera")
USDVIEW_OTHER_QT = "usdslf: this usdview does not run on PySide6, which the painting window needs"


def usdview_without_qt(error: ImportError) -> str:
    """Returns why the painting window cannot be opened from usdview."""
    return f"usdslf: the painting window needs PySide6 (pip install 'usdslf[viewer]'): {error}"


def dome_without_picture(paths: list[str]) -> str:
    """Returns what Storm does not show of domes, by their paths."""
    return f"Storm neither shines with domes that have no texture nor shows them: {', '.join(paths)}"


def no_hydra(pxr: str, error: ImportError) -> str:
    """Returns why Hydra cannot be used although it is installed."""
    return f"{pxr} cannot be loaded ({error}): the built-in viewport is used"


CLOSE_BAR = "Close"
CANCEL_BUTTON = "Cancel"
STAGE_PANEL, BRUSH_PANEL, FOUND_PANEL = "Stage", "Brush", "Understood"
CHOOSE_STROKES, CHOOSE_LOOK = "Where the strokes go", "Where the look goes"

# The panel Brush.
SIZE, STRENGTH = "Si&ze", "S&trength"
PRESSURE = ("Pen pressure sets the width", "A pen that presses less paints narrower")
PICK_SQUARE, PICK_HUE = "Saturation and value, as the screen shows them; arrow keys", "Hue; arrow keys"
PICK_HEX = "Code value of the screen, #rrggbb"
TOOLS = {
    "replace": ("Replace", "Paint the colour that the surface should show"),
    "clone": ("Clone", "Paint the look of another place; Ctrl+click takes it"),
    "brighten": ("Brighten", "More light comes from here, by strength"),
    "darken": ("Darken", "Less light comes from here, by strength"),
    "blur": ("Blur", "Softer highlights and reflections"),
    "sharpen": ("Sharpen", "Crisper highlights and reflections"),
    "fixate": ("Fixate", "The material here stays as it is, whatever else is painted"),
}
TOOL_KEYS = {
    "replace": "R", "clone": "C", "brighten": "H", "darken": "D", "blur": "U", "sharpen": "P", "fixate": "X",
}  # fmt: skip
HINTS = {
    "clone": "Ctrl+click where the look is to come from, then paint.",
    "fixate": "What is painted is locked: no change may touch it.",
}
CHOICES = {
    "mode": ("&Mode", "Whether what is painted changes, or what its light comes from"),
    "scope": ("&Scope", "How far the change may spread"),
    "norm": ("Chan&ge", "How many of diffuse, specular and glossiness may change"),
    "space": ("Co&lour is", "What the colour means"),
}
VALUES = {
    "direct": ("Direct", "What is painted changes"),
    "indirect": ("Indirect", "What is painted stays; what its light comes from changes"),
    "stroke": ("The faces painted", ""),
    "prim": ("The gprim", ""),
    "material": ("The material", "All that shows the material"),
    "similar": ("Similar materials too", ""),
    "mixed": ("As few as it takes", ""),
    "l0": ("One alone", ""),
    "l2": ("All at once", ""),
    "scene": ("Light as seen", "Scene-linear radiance of the surface as it is seen"),
    "reflectance": ("Albedo", "An albedo-like colour, lit as the surface is"),
}


def scene_linear(color: tuple[float, float, float]) -> str:
    """Returns a colour's numbers."""
    return "scene-linear  " + "  ".join(f"{c:.3f}" for c in color)


# The bar above the picture.
POINTERS = {
    "select": ("Select", "Click on a surface to select its gprim"),
    "paint": ("Paint", "Paint a stroke; Shift: a straight line; B and drag: the brush's size"),
    "eyedropper": ("Eyedropper", "Take a colour of the picture, scene-linear; Ctrl+click does it too"),
}
POINTER_KEYS = {"select": "Q", "paint": "W", "eyedropper": "I"}
CAMERA_TIP = "What is looked through; Alt and the mouse leave it for a free camera"
FREE_CAMERA, OVERVIEW = "Free camera", "Overview"
GATE = ("Film &gate", "Dim what lies outside the film of the camera")
DRAWN = {"outline": "Outlines", "paint": "Raw paint", "hidden": "No strokes"}
DRAWN_TIP = "How strokes are drawn over the picture"
EXPOSURE = ("Exposure", "Stops, before the view; nothing that is saved changes")
GAMMA = ("Gamma", "Exponent after the view; nothing that is saved changes")
DISPLAY, DISPLAY_PARTS, NO_LOOK = "&Display", ("&Display device", "&View", "&Look"), "the view's own"
DISPLAY_TIP = "How the picture is brought to the screen; nothing that is saved changes"
CHANNELS = {  # name, what its tooltip adds, key
    "color": ("&Colours", "All channels through the view", "Shift+C"),
    "red": ("&Red", "The red channel as grey; once more: the colours", "Shift+R"),
    "green": ("&Green", "The green channel as grey; once more: the colours", "Shift+G"),
    "blue": ("&Blue", "The blue channel as grey; once more: the colours", "Shift+B"),
    "luminance": ("L&uminance", "How bright it is, as grey; once more: the colours", "Shift+L"),
    "false_color": ("&False colour", "Stops about middle grey, after exposure; once more: the colours", "Shift+F"),
}
RESET_DISPLAY = ("R&eset exposure and gamma", "", "Shift+E")
FRAME_ALL = ("Frame &all", "Look at everything")
THROUGH = ("Look through the first &camera", "Back to the shot's own camera")
WIDER = ("&Wider brush", "")
NARROWER = ("&Narrower brush", "")
NEXT_DRAWN = ("Show &strokes otherwise", "Outlined, as painted, hidden")
SEARCH = "Search prims by name, type or path"
COLUMNS = ("Prim", "Type")


def shows_material(path: str) -> str:
    """Returns which material a prim shows."""
    return f"shows {path}"


# The timeline.
PLAY, PLAY_KEY = ("&Play", "Frames that are late are left out"), "Space"
FRAME_TIP = "The frame that is shown"


def frames(first: float, last: float, per_second: float) -> str:
    """Returns the frames of a shot."""
    return f"{first:g} to {last:g}, {per_second:g} a second"


# The cheat sheet.
KEYS = ("&Keys and mouse", "All shortcuts in one window")
MOUSE = "Mouse and pen"
GESTURES = (
    ("Alt + left", "Orbit"),
    ("Alt + middle, middle", "Pan"),
    ("Alt + right, wheel", "Dolly"),
    ("Left", "Paint, select or take a colour"),
    ("Shift + left", "Paint a straight line"),
    ("B + left", "Change the brush's size"),
    ("Ctrl + left", "Take a colour; with Clone: its source"),
    ("Esc", "Give up the stroke under way"),
)

# Questions.
NOT_SAVED = "Strokes of this shot are not saved."
NOT_SAVED_MORE = "Save them before going on?"
RECOVER, DISCARD, RELOAD = "Recover", "Discard", "Reload"
STAGE_CHANGED = "The shot has changed on the disk. Reload it and put the strokes on it again?"


def found_unsaved(count: int, at: str) -> str:
    """Returns what is asked where an earlier session did not end well."""
    many = "1 stroke was" if count == 1 else f"{count} strokes were"
    return f"{many} painted until {at} and not saved. Recover?"


def recovery() -> str:
    """Returns the name of the step of undo that a recovery is."""
    return "recovery"
