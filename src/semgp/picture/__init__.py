"""Pictures without display or GPU."""

from semgp.picture.colour import COLOUR_MAPS, GREY, by_class, by_value
from semgp.picture.compose import colour_bar, legend, panels, stack
from semgp.picture.image import save_png
from semgp.picture.splat import DARK, WHITE, disc_sizes, splat
from semgp.picture.view import View, view_of

__all__ = [
    "COLOUR_MAPS",
    "DARK",
    "GREY",
    "WHITE",
    "View",
    "by_class",
    "by_value",
    "colour_bar",
    "disc_sizes",
    "legend",
    "panels",
    "save_png",
    "splat",
    "stack",
    "view_of",
]
