#!/usr/bin/python3
"""Draws scenes as thumbnails on one sheet, rendered by a chapter's program.

    sheet.py PROGRAM [SHEET.png] [SCENE…] [--limit SECONDS] [--columns N]

Scenes are names or files; without any, all that are here. A scene whose rays × triangles would take longer than the
limit gets fewer pixels (1/4, 1/16), and none if that does not help; the sheet says so. How fast the program is, it
is asked first.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile

try:
    import matplotlib
    import numpy as np
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.image import imread
except ImportError as missing:
    sys.exit(f"error: sheets need matplotlib (python3-matplotlib, for /usr/bin/python3): {missing}")

matplotlib.rcdefaults()  # the reader's own matplotlibrc must not change a sheet
matplotlib.rcParams.update({"font.family": "DejaVu Sans", "text.parse_math": False})

WIDTH, HEIGHT = 160, 120
GAP, TEXT = 8, 26  # pixels: around a thumbnail, and below it for two lines
SHRINKS = (1, 2, 4)
TALLEST = 32000  # pixels: what readers of images take
CARD, INK, GREY, RED, EMPTY = "#fdfdfb", "#222222", "#666666", "#a03000", "#e4e3de"


class Refused(Exception):
    """What the user is told in one line."""


def run(program, *arguments, seconds=None):
    """What the program prints. Throws Refused with its message, or where it takes longer."""
    try:
        done = subprocess.run([program, *arguments], capture_output=True, text=True, errors="replace",
                              stdin=subprocess.DEVNULL, timeout=seconds, check=False)
    except subprocess.TimeoutExpired:
        raise Refused(f"stopped after {seconds:.0f} s") from None
    except OSError as error:
        raise Refused(f"{program}: {error.strerror}") from None
    if done.returncode != 0:
        said = [line for line in done.stderr.splitlines() if line.startswith("error: ")]
        raise Refused(said[-1][7:] if said else f"{program} ended with {done.returncode}")
    return done.stdout


def render(program, scene, shrink, image, seconds):
    """The program's JSON about the scene, rendered into the file."""
    return json.loads(run(program, "--headless", "--scene", scene, "--output", image, "--json", "--size",
                          f"{WIDTH // shrink}x{HEIGHT // shrink}", seconds=seconds))


class Renderer:
    """Renders within a limit of seconds a scene, as far as rays × triangles can tell before."""

    def __init__(self, program, limit):
        self.program, self.limit = program, limit
        self.folder = tempfile.TemporaryDirectory(prefix="trilha_sheet_")
        self.image = os.path.join(self.folder.name, "thumbnail.png")
        self.tests_per_s = 0.0
        self.learn(render(program, "teaset", 2, self.image, None))

    def learn(self, result):
        """The best rate so far: small scenes and first calls are slower than what is to be foreseen."""
        tests = result["mrays_per_s"] * 1e6 * result["triangles"]
        self.tests_per_s = max(self.tests_per_s, tests)

    def tile(self, scene, triangles):
        """(pixels or None, caption, has it gone wrong)"""
        try:
            if triangles is None:  # a file: one ray tells how many
                triangles = json.loads(run(self.program, "--headless", "--scene", scene, "--output", self.image,
                                           "--json", "--size", "1x1", seconds=10 * self.limit))["triangles"]
            seconds = [WIDTH * HEIGHT / n**2 * triangles / self.tests_per_s for n in SHRINKS]
            shrink = next((n for n, s in zip(SHRINKS, seconds) if s <= self.limit), None)
            if shrink is None:
                return None, f"{count(triangles)}: left out, about {seconds[-1]:.0f} s", True
            result = render(self.program, scene, shrink, self.image, 10 * self.limit + 60)
            self.learn(result)
            pixels = imread(self.image)[..., :3]
            pixels = np.repeat(np.repeat(pixels, shrink, axis=0), shrink, axis=1)
            small = "" if shrink == 1 else f", 1/{shrink**2} of the pixels"
            return pixels, count(result["triangles"]) + small, False
        except Refused as refusal:
            return None, str(refusal), True


def count(triangles):
    return f"{triangles:,}".replace(",", " ") + (" triangle" if triangles == 1 else " triangles")


def names_of(scenes):
    """What is written below: the ends of files' paths that tell them apart."""
    shown = []
    for scene in scenes:
        parts = scene.split("/")
        length = 1
        while length < len(parts) and any(
                other != scene and other.split("/")[-length:] == parts[-length:] for other in scenes):
            length += 1
        shown.append("/".join(parts[-length:]) if os.path.splitext(scene)[1] else scene)
    return shown


def draw(tiles, columns, path):
    """Puts (name, pixels, caption, wrong) on a sheet, pixel by pixel."""
    rows = -(-len(tiles) // columns)
    width, height = columns * (WIDTH + GAP) + GAP, rows * (HEIGHT + TEXT + GAP) + GAP
    if height > TALLEST:
        raise Refused(f"{path}: {len(tiles)} scenes in {columns} columns are {height} pixels high; more --columns")
    dpi = 100
    figure = Figure(figsize=(width / dpi, height / dpi), dpi=dpi, facecolor=CARD)
    canvas = FigureCanvasAgg(figure)
    for i, (name, pixels, caption, wrong) in enumerate(tiles):
        left = GAP + i % columns * (WIDTH + GAP)
        top = GAP + i // columns * (HEIGHT + TEXT + GAP)
        if pixels is None:
            pixels = np.full((HEIGHT, WIDTH, 3), [int(EMPTY[k:k + 2], 16) / 255 for k in (1, 3, 5)])
        figure.figimage(pixels, left, height - top - HEIGHT, origin="upper")
        for line, (text, colour) in enumerate(((name, INK), (caption, RED if wrong else GREY))):
            write(figure, canvas, text, left / width, 1 - (top + HEIGHT + 2 + 12 * line) / height, colour)
    figure.savefig(path, format="png", dpi=dpi, facecolor=CARD, metadata={"Software": None})


def write(figure, canvas, text, x, y, colour):
    """Writes the text under its thumbnail; what is too long loses its middle."""
    text = "".join(c if c.isprintable() else "?" for c in text)
    label = figure.text(x, y, text, fontsize=6.5, color=colour, va="top")
    keep = len(text)
    while keep > 8 and label.get_window_extent(canvas.get_renderer()).width > WIDTH:
        keep -= 1
        label.set_text(text[:keep // 2] + "…" + text[len(text) - (keep - keep // 2 - 1):])


def main():
    parser = argparse.ArgumentParser(prog="./trilha sheet", description="thumbnails of scenes on one sheet")
    parser.add_argument("program", help=argparse.SUPPRESS)
    parser.add_argument("names", nargs="*", metavar="SHEET.png SCENE…", help="[scenes.png] [all that are here]")
    parser.add_argument("--limit", type=float, default=20, metavar="SECONDS", help="for a scene [20]")
    parser.add_argument("--columns", type=int, metavar="N", help="[as many as make the sheet wider than high]")
    arguments = parser.parse_args()
    path, *scenes = arguments.names or ["scenes.png"]
    if not path.endswith(".png"):
        raise Refused(f"{path}: a sheet is a .png; name it first, then the scenes")
    if arguments.limit <= 0 or (arguments.columns is not None and not 1 <= arguments.columns <= 190):
        raise Refused("--limit is above 0, --columns goes from 1 to 190")
    if not os.path.isdir(os.path.dirname(path) or "."):
        raise Refused(f"{path}: its folder is not there; make it first")

    known = {scene["name"]: scene for scene in json.loads(run(arguments.program, "--list-scenes", "--json"))["scenes"]}
    if not scenes:
        scenes = [name for name, scene in known.items() if scene["here"]]
    renderer = Renderer(arguments.program, arguments.limit)
    tiles, wrong = [], 0
    for i, (scene, name) in enumerate(zip(scenes, names_of(scenes))):
        if sys.stderr.isatty():
            print(f"\r\x1b[K[{i + 1}/{len(scenes)}] {scene[:70]}", end="", file=sys.stderr, flush=True)
        pixels, caption, failed = renderer.tile(scene, known.get(scene, {}).get("triangles"))
        tiles.append((name, pixels, caption, failed))
        if failed:
            wrong += 1
            print(("\r\x1b[K" if sys.stderr.isatty() else "") + f"not drawn: {scene}: {caption}", file=sys.stderr)
    if sys.stderr.isatty():
        print("\r\x1b[K", end="", file=sys.stderr)
    columns = arguments.columns or min(len(tiles), max(4, round((len(tiles) * 1.2) ** 0.5)))
    draw(tiles, columns, path)
    print(f"{path}: {len(tiles) - wrong} scenes" + (f", {wrong} not drawn" if wrong else ""))


if __name__ == "__main__":
    try:
        main()
    except (Refused, OSError) as refused:
        sys.exit(f"error: {refused}")
    except KeyboardInterrupt:
        sys.exit(130)
