"""Theme: neutral greys, so that nothing near the picture changes how its colours are seen."""

from __future__ import annotations

from PySide6.QtGui import QColor, QPalette
from PySide6.QtWidgets import QApplication

GROUND, PANEL, FIELD, RAISED = "#3a3a3a", "#444444", "#2e2e2e", "#555555"
TEXT, DIM, ACCENT = "#d8d8d8", "#aaaaaa", "#c9a227"  # the dim one has 4.5 times the contrast of a card, too
FOCUS = "#f2f2f2"  # round what has the keys; what is chosen has the accent
ERROR, NOTE = "#8c3b34", "#4d5a66"
COVERED = "#5fa8d3"  # what a scope covers; what is selected has the accent

SHEET = f"""
QWidget {{ font-size: 12px; }}
QMainWindow::separator {{ background: {GROUND}; width: 4px; height: 4px; }}
QDockWidget::title {{ background: {GROUND}; padding: 5px 8px; }}
QToolTip {{ background: {FIELD}; color: {TEXT}; border: 1px solid {DIM}; padding: 4px; }}
QToolButton {{ border: 1px solid transparent; border-radius: 3px; padding: 4px 8px; }}
QToolButton:hover {{ background: {RAISED}; }}
QToolButton:checked {{ background: {FIELD}; border-color: {ACCENT}; }}
*:focus {{ outline: none; }}
QPushButton, QComboBox, QLineEdit {{
  background: {FIELD}; border: 1px solid #262626; border-radius: 3px; padding: 3px 6px; min-height: 18px; }}
ToolButtons QToolButton {{ padding: 4px 1px; }}
QPushButton:hover {{ background: {RAISED}; }}
QPushButton:checked {{ border: 1px solid {ACCENT}; color: {ACCENT}; }}
QPushButton:focus, QComboBox:focus, QLineEdit:focus, QToolButton:focus,
QSlider:focus, QTreeView:focus, QListView:focus, QToolButton:checked:focus {{ border: 1px solid {FOCUS}; }}
QCheckBox {{ border: 1px solid transparent; border-radius: 3px; padding: 2px; }}
QCheckBox:focus, QTabBar:focus {{ border-color: {FOCUS}; }}
QTreeView::item {{ min-height: 20px; }}
QDialogButtonBox, QMessageBox {{ dialogbuttonbox-buttons-have-icons: 0; }}
QLabel[isDim="true"] {{ color: {DIM}; }}
QToolButton[isTight="true"] {{ padding: 3px 3px; }}
#card {{ background: #3f3f3f; border: 1px solid #303030; border-radius: 4px; }}
QTreeView, QListView {{ background: {FIELD}; border: 1px solid #262626; alternate-background-color: #323232; }}
QHeaderView::section {{ background: {PANEL}; border: none; padding: 3px 6px; }}
QStatusBar {{ background: {GROUND}; }}
QStatusBar::item {{ border: none; }}
QProgressBar {{ background: {FIELD}; border: none; border-radius: 2px; max-height: 6px; }}
QProgressBar::chunk {{ background: {ACCENT}; border-radius: 2px; }}
QSlider::groove:horizontal {{ background: {FIELD}; height: 4px; border-radius: 2px; }}
QSlider::handle:horizontal {{ background: {TEXT}; width: 10px; margin: -5px 0; border-radius: 5px; }}
QGroupBox {{ border: none; margin-top: 18px; font-weight: bold; }}
QGroupBox::title {{ subcontrol-origin: margin; left: 0; color: {DIM}; }}
"""


def apply_theme(application: QApplication) -> None:
    """Gives an application the neutral theme."""
    application.setStyle("Fusion")
    palette, role = QPalette(), QPalette.ColorRole
    for roles, color in (
        ((role.Window, role.Button), PANEL),
        ((role.Base, role.ToolTipBase, role.Dark), FIELD),
        ((role.AlternateBase,), "#323232"),
        ((role.WindowText, role.Text, role.ButtonText, role.BrightText, role.ToolTipText, role.HighlightedText), TEXT),
        ((role.PlaceholderText,), DIM),
        ((role.Highlight,), "#6b5a1e"),
        ((role.Link,), ACCENT),
        ((role.Light, role.Midlight), RAISED),
        ((role.Mid, role.Shadow), "#262626"),
    ):
        for each in roles:
            palette.setColor(each, QColor(color))
    for each in (role.WindowText, role.Text, role.ButtonText):
        palette.setColor(QPalette.ColorGroup.Disabled, each, QColor("#777777"))
    application.setPalette(palette)
    application.setStyleSheet(SHEET)
