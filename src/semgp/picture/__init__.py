"""Pictures without display or GPU."""

from semgp.picture.animation import save_animation
from semgp.picture.camera import Camera
from semgp.picture.colour import COLOUR_MAPS, GREY, by_class, by_value
from semgp.picture.compose import colour_bar, legend, panels, stack
from semgp.picture.coverage import picture_resolution, surface_points
from semgp.picture.image import save_png
from semgp.picture.paint import Paint, paint, paint_labels
from semgp.picture.portrait import Layer, cloud_layers, map_layers, portrait
from semgp.picture.splat import DARK, WHITE, disc_sizes, splat
from semgp.picture.view import View, view_of

__all__ = [
    "COLOUR_MAPS",
    "DARK",
    "GREY",
    "WHITE",
    "Camera",
    "Layer",
    "Paint",
    "View",
    "by_class",
    "by_value",
    "cloud_layers",
    "colour_bar",
    "disc_sizes",
    "legend",
    "map_layers",
    "paint",
    "paint_labels",
    "panels",
    "picture_resolution",
    "portrait",
    "save_animation",
    "save_png",
    "splat",
    "stack",
    "surface_points",
    "view_of",
]
