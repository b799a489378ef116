"""Prints as JSON the map that a `map.yaml` names, by the rules of map_server's documentation: `map_server.py MAP.yaml`. And map.png must open."""

import json
import sys
from pathlib import Path

import yaml
from PIL import Image

file = Path(sys.argv[1])
described = yaml.safe_load(file.read_text())
assert described.get("mode", "trinary") == "trinary"
with Image.open(file.parent / described["image"]) as picture:
    assert picture.mode == "L", picture.mode
    width, height = picture.size
    pixels = list(picture.tobytes())


def cell(pixel):
    """Whiter is freer, unless negated; what is neither is unknown."""
    occupied = pixel / 255.0 if described["negate"] else (255 - pixel) / 255.0
    if occupied > described["occupied_thresh"]:
        return 100
    return 0 if occupied < described["free_thresh"] else -1


# A picture begins at its upper left pixel, a grid at its lower left cell.
rows = [pixels[row * width : (row + 1) * width] for row in range(height)]
cells = [cell(pixel) for row in reversed(rows) for pixel in row]
with Image.open(file.parent / "map.png") as picture:
    picture.load()
    drawn = [picture.format, *picture.size]
json.dump({"size": [width, height, described["resolution"]], "origin": described["origin"], "cells": cells, "picture": drawn}, sys.stdout)
