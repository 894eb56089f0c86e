#!/usr/bin/python3
"""Draws a report: every experiment of DIR/report.json and the table of DIR/stability.json, as SVG and PNG.

    plot.py DIR [--out DIR] [--print]

All drawing happens on a Sheet whose unit is the point (1/72 inch). A Scale takes values to points, zeros and
infinities to rails of their own, and so whatever comes later (labels, leaders, the Pareto front) is plane
geometry. The same JSON gives the same bytes.
"""

import argparse
import io
import json
import math
import os
import re
import shutil
import sys
import tempfile
import warnings
from collections import Counter, namedtuple
from functools import lru_cache

try:
    import matplotlib
    import numpy as np
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.font_manager import FontProperties
    from matplotlib.image import AxesImage, imread
    from matplotlib.lines import Line2D
    from matplotlib.patches import FancyBboxPatch, Rectangle
    from matplotlib.patheffects import withStroke
    from matplotlib.text import Text
    from matplotlib.textpath import TextToPath
    from matplotlib.transforms import Affine2D
except ImportError as missing:
    sys.exit(f"error: plotting needs matplotlib (python3-matplotlib, for /usr/bin/python3): {missing}")

matplotlib.rcdefaults()  # the reader's own matplotlibrc must not change a figure
matplotlib.rcParams.update({"svg.hashsalt": "trilha", "svg.fonttype": "path", "font.family": "DejaVu Sans",
                            "mathtext.fontset": "dejavusans"})
warnings.filterwarnings("ignore", message="Glyph .* missing")

WIDTH = 504.0  # a column of print, 7 inches
TALLEST = 684.0  # 9.5 inches: what is taller goes to a further page
MARGIN = 12.0
INNER = WIDTH - 2 * MARGIN
DPI = 200
PIXEL = 72 / DPI
SMALL = 8.0  # the smallest type

CARD, INK, GREY, FAINT, BAND, FRONT = "#fdfdfb", "#222222", "#666666", "#e4e3de", "#f1efe8", "#c9c7be"
# Okabe and Ito's colours, which the colour-blind can tell apart, ordered so that the first ones also differ
# in lightness, for prints without colour. Yellow is missing: it does not show on paper.
COLOURS = ["#0072b2", "#e69f00", "#000000", "#009e73", "#d55e00", "#56b4e9", "#cc79a7"]
DASHES = [(0, ()), (0, (5, 1.6)), (0, (1.2, 1.4)), (0, (6, 1.6, 1.2, 1.6)), (0, (3, 1, 1, 1, 1, 1)),
          (0, (9, 2)), (0, (2, 3))]
SHAPES = ["o", "s", "^", "D", "v", "P", "X", "p", "h", "<", ">", "*"]


def ink(colour):
    """The colour, darkened until text in it can be read on the card (a contrast of 4.5, as WCAG asks)."""
    rgb = np.array([int(colour[i:i + 2], 16) / 255 for i in (1, 3, 5)])

    def luminance(parts):
        return np.where(parts <= 0.04045, parts / 12.92,
                        ((parts + 0.055) / 1.055) ** 2.4) @ [0.2126, 0.7152, 0.0722]

    while 1.05 / (luminance(rgb) + 0.05) < 4.6:
        rgb = rgb * 0.96
    return "#" + "".join(f"{round(part * 255):02x}" for part in rgb)


class Refused(Exception):
    """What the user is told in one line."""


# --- reading


def clean(thing):
    """The same JSON, its strings without what no SVG, table or terminal can hold."""
    if isinstance(thing, str):
        text = thing.encode("utf-8", "replace").decode()
        return re.sub(r"[\x00-\x1f\x7f-\x9f\u2028\u2029\ufffe\uffff]+", " ", text)
    if isinstance(thing, list):
        return [clean(item) for item in thing]
    if isinstance(thing, dict):
        return {clean(key): clean(value) for key, value in thing.items()}
    return thing


def read_json(path):
    try:
        with open(path, encoding="utf-8") as file:
            document = clean(json.load(file))
    except OSError as error:
        raise Refused(f"{path}: {error.strerror}") from None
    except RecursionError:
        raise Refused(f"{path}: nested too deeply") from None
    except ValueError as error:  # broken JSON, or not UTF-8
        raise Refused(f"{path}: {error}") from None
    if not isinstance(document, dict):
        raise Refused(f"{path}: not a JSON object")
    return document


def need(thing, key, where, kind):
    """thing[key], which must be there and of a kind (a type, or several)."""
    if not isinstance(thing, dict):
        raise Refused(f"{where}: not an object")
    if key not in thing:
        raise Refused(f'{where}: "{key}" is missing')
    if not isinstance(thing[key], kind):
        raise Refused(f'{where}: "{key}" is not {NAMES.get(kind, "an object")}')
    return thing[key]


NAMES = {str: "a text", list: "a list", dict: "an object", int: "a whole number"}


def number(value, where):
    """A float, or None for what is absent. JSON has no infinity; the reports write a text."""
    if value is None:
        return None
    if isinstance(value, str) and value in ("Infinity", "-Infinity", "NaN"):
        return float(value)
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise Refused(f"{where}: {json.dumps(value)[:40]} is not a number")
    try:
        return float(value)
    except OverflowError:
        return math.copysign(math.inf, value)


def error_of(thing, where):
    need(thing, "kind", where, str)
    return {"kind": thing["kind"],
            **{name: number(thing.get(name), f"{where}.{name}") for name in ("value", "low", "high")}}


COUNTS = ("build_ms", "rays", "mrays_per_s", "node_visits", "primitive_tests", "bytes")


def read_row(raw, where):
    row = {"experiment": need(raw, "experiment", where, str), "technique": need(raw, "technique", where, str),
           "scene": raw.get("scene") or "", "backend": raw.get("backend") or "cpu",
           "settings": raw.get("settings") or {}, "time_ms": None, "published": None}
    for name in ("scene", "backend"):
        need(row, name, where, str)
    need(row, "settings", where, dict)
    for name, value in row["settings"].items():
        if not isinstance(value, (str, int, float, bool, type(None))):
            raise Refused(f"{where}.settings.{name}: not a text, a number or a truth value")
    if raw.get("time_ms") is not None:
        need(raw, "time_ms", where, dict)
        row["time_ms"] = {name: number(raw["time_ms"].get(name), f"{where}.time_ms.{name}")
                          for name in ("median", "q1", "q3", "repeats")}
    need(raw, "error", where, dict)
    errors = raw.get("errors") or []
    if not isinstance(errors, list):
        raise Refused(f'{where}: "errors" is not a list')
    row["errors"] = [error_of(raw["error"], f"{where}.error")]
    for i, error in enumerate(errors):
        error = error_of(error, f"{where}.errors[{i}]")
        if all(error["kind"] != known["kind"] for known in row["errors"]):
            row["errors"].append(error)
    for name in COUNTS:
        row[name] = number(raw.get(name), f"{where}.{name}")
    published = raw.get("published")
    if published is not None:
        by = need(published, "by", f"{where}.published", str)
        error = published.get("error")
        if error is not None and not isinstance(error, dict):
            error = {"kind": row["errors"][0]["kind"], "value": error}
        row["published"] = {
            "by": by, "hardware": str(published.get("hardware") or ""),
            "time_ms": number(published.get("time_ms"), f"{where}.published.time_ms"),
            "errors": [error_of(error, f"{where}.published.error")] if error is not None else []}
    return row


def read_axis(experiment, name, where):
    axis = need(experiment, name, where, dict)
    quantity = need(axis, "quantity", f"{where}.{name}", str)
    free = quantity == "error" or quantity.startswith(("error.", "settings."))
    if quantity not in QUANTITIES and not free:
        raise Refused(
            f"{where}.{name}: no quantity is called {quantity}; there are: {', '.join(QUANTITIES)}, "
            "error, error.KIND, settings.NAME")
    log = axis.get("log", True) is not False
    return {"quantity": quantity, "label": str(axis.get("label") or quantity), "log": log}


def read_experiment(raw, where):
    name = need(raw, "name", where, str)
    experiment = {"name": name, "rows_of": str(raw.get("rows_of") or name),
                  "title": str(raw.get("title") or name), "note": str(raw.get("note") or ""),
                  "join": raw.get("join", False) is True,
                  "x": read_axis(raw, "x", where), "y": read_axis(raw, "y", where)}
    for name in ("figure", "panel", "line", "mark"):
        fields = raw.get(name) or []
        if not isinstance(fields, list):
            raise Refused(f'{where}: "{name}" is not a list')
        for field in fields:
            if field not in ("scene", "backend", "technique") and not str(field).startswith("settings."):
                raise Refused(f"{where}.{name}: no field is called {field}; there are: scene, backend, "
                              "technique, settings.NAME")
        experiment[name] = fields
    return experiment


def default_experiment(name, rows):
    """What is drawn of rows whose report does not say how."""
    kinds = list(dict.fromkeys(row["errors"][0]["kind"] for row in rows))
    return {"name": name, "rows_of": name, "title": name, "note": "", "join": False,
            "x": {"quantity": "time_ms", "label": "time, ms", "log": True},
            "y": {"quantity": "error", "label": "error: " + ", ".join(kinds), "log": True},
            "figure": ["backend"], "panel": ["scene"], "line": ["technique"], "mark": []}


def read_report(path):
    report = read_json(path)
    need(report, "chapter", path, str)
    rows = [read_row(raw, f"{path}: rows[{i}]") for i, raw in enumerate(need(report, "rows", path, list))]
    raw = report.get("experiments") or []
    if not isinstance(raw, list):
        raise Refused(f'{path}: "experiments" is not a list')
    experiments = [read_experiment(one, f"{path}: experiments[{i}]") for i, one in enumerate(raw)]
    twice = [name for name, count in Counter(one["name"] for one in experiments).items() if count > 1]
    if twice:
        raise Refused(f"{path}: two of the experiments are called {twice[0]}")
    left_out = report.get("left_out") or []
    if not isinstance(left_out, list):
        raise Refused(f'{path}: "left_out" is not a list')
    known = {experiment["rows_of"] for experiment in experiments}
    for name in dict.fromkeys(row["experiment"] for row in rows if row["experiment"] not in known):
        experiments.append(default_experiment(name, [row for row in rows if row["experiment"] == name]))
    for experiment in experiments:
        for quantity in (experiment["x"]["quantity"], experiment["y"]["quantity"]):
            for i, row in enumerate(rows):
                if quantity.startswith("settings.") and row["experiment"] == experiment["rows_of"]:
                    number(row["settings"].get(quantity[9:]),
                           f"{path}: rows[{i}].{quantity}, an axis of {experiment['name']}")
    return {**report, "path": path, "rows": rows, "experiments": experiments,
            "left_out": [str(what) for what in left_out]}


# --- quantities

Measure = namedtuple("Measure", "value low high")  # low and high may be None


def time_of(row, times=1.0, plus=0.0):
    time = row["time_ms"]
    if time is None or time["median"] is None or times is None or plus is None:
        return None
    names = ("median", "q1", "q3")
    return Measure(*(None if time[name] is None else time[name] * times + plus for name in names))


def count_of(row, name):
    return None if row[name] is None else Measure(row[name], None, None)


def ratio(above, below):
    return above / below if above is not None and below else None


def per(row, above, below):
    value = ratio(row[above], row[below])
    return None if value is None else Measure(value, None, None)


QUANTITIES = {
    "time_ms": time_of,
    "total_ms": lambda row: time_of(row, plus=row["build_ms"]),
    "ns_per_test": lambda row: time_of(row, times=ratio(1e6, row["primitive_tests"])),
    "ns_per_ray": lambda row: time_of(row, times=ratio(1e6, row["rays"])),
    "ms_per_ray": lambda row: time_of(row, times=ratio(1.0, row["rays"])),
    "tests_per_ray": lambda row: per(row, "primitive_tests", "rays"),
    "nodes_per_ray": lambda row: per(row, "node_visits", "rays"),
    **{name: (lambda row, name=name: count_of(row, name)) for name in COUNTS},
}
# A front is drawn where less is better on both axes.
LESS_IS_BETTER = {
    "time_ms", "total_ms", "ns_per_test", "ns_per_ray", "ms_per_ray", "tests_per_ray", "nodes_per_ray",
    "build_ms", "bytes"
}


def less_is_better(quantity):
    return quantity in LESS_IS_BETTER or quantity.split(".")[0] == "error"


def error_named(row, kind):
    return next((error for error in row["errors"] if error["kind"] == kind), None)


def measure(row, quantity):
    """The quantity in a row, or None where the row has no number for it."""
    if quantity in QUANTITIES:
        found = QUANTITIES[quantity](row)
    elif quantity.startswith("settings."):
        found = Measure(number(row["settings"].get(quantity[9:]), quantity), None, None)
    else:
        kind = quantity[len("error."):]
        error = error_named(row, kind) if kind else next(iter(row["errors"]), None)
        found = error and Measure(error["value"], error["low"], error["high"])
    if found is None or found.value is None or math.isnan(found.value):
        return None
    return found


def machine(backend):
    return {"cpu": "CPU", "cuda": "CUDA"}.get(backend, backend)


def words_of(row, field):
    """A field's value as it stands in titles and labels."""
    if field == "backend":
        return machine(row["backend"])
    if not field.startswith("settings."):
        return row[field]
    name = field[9:]
    value = row["settings"].get(name)
    if isinstance(value, bool):
        return name if value else f"no {name}"
    if isinstance(value, (int, float)):
        return f"{name} {plain(value)}"
    return "–" if value is None else value


def words(row, fields):
    return " · ".join(words_of(row, field) for field in fields)


# --- numbers as text

SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def plain(value):
    """A number as somebody wrote it: 1000, 0.25, 1e-18."""
    if isinstance(value, int) and abs(value) < 10 ** 15:
        return str(value)
    return re.sub(r"e([+-])0*", lambda match: "e" + match[1].strip("+"), f"{number(value, ''):.10g}")


def rounded(value, digits=3):
    """A measured number, to three digits."""
    if value is None:
        return "–"
    if math.isnan(value):
        return "NaN"
    if math.isinf(value):
        return "∞" if value > 0 else "−∞"
    if value == 0:
        return "0"
    if value == int(value) and abs(value) < 10 ** digits:  # a count
        return str(int(value)).replace("-", "−")
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    exponent = int(exponent)
    if -3 <= exponent < 5:
        return f"{float(f'{value:.{digits - 1}e}'):.{max(0, digits - 1 - exponent)}f}".replace("-", "−")
    return f"{mantissa}·10{str(exponent).translate(SUPERSCRIPTS)}".replace("-", "−")


def counted(value):
    """A count: with thin spaces, or rounded where it is long."""
    return f"{value:,}".replace(",", "\u2009") if value < 10 ** 6 else rounded(float(value))


# --- text and its size


@lru_cache(maxsize=None)
def font(size, weight="normal", style="normal"):
    return FontProperties(family="DejaVu Sans", size=size, weight=weight, style=style)


@lru_cache(maxsize=100000)
def width_of(text, size=SMALL, weight="normal", maths=False):
    return TextToPath().get_text_width_height_descent(text, font(size, weight), maths)[0] if text else 0.0


@lru_cache(maxsize=100000)
def fit(text, width, size=SMALL, weight="normal"):
    """The text, shortened with an ellipsis where it is too wide."""
    if width_of(text, size, weight) <= width:
        return text
    low, high = 0, len(text)
    while low < high:
        middle = (low + high + 1) // 2
        if width_of(text[:middle].rstrip() + "…", size, weight) <= width:
            low = middle
        else:
            high = middle - 1
    return text[:low].rstrip() + "…"


def wrap(text, width, most, size=SMALL, weight="normal"):
    """The text in at most so many lines."""
    lines, rest = [], text.split()
    while rest and len(lines) < most:
        line = rest.pop(0)
        if len(lines) == most - 1:
            lines.append(fit(" ".join([line] + rest), width, size, weight))
            break
        while rest and width_of(f"{line} {rest[0]}", size, weight) <= width:
            line += " " + rest.pop(0)
        lines.append(fit(line, width, size, weight))
    return lines


def wrap_parts(parts, width, most=2):
    """Parts with dots between them, broken only there if that fits."""
    lines = []
    for part in parts:
        if lines and width_of(f"{lines[-1]} · {part}") <= width:
            lines[-1] += f" · {part}"
        else:
            lines.append(part)
    if len(lines) > most or any(width_of(line) > width for line in lines):
        return wrap(" · ".join(parts), width, most)
    return lines


# --- the sheet


class Sheet:
    """A page: a card of any height, and what is drawn on it, in points from its lower left corner."""

    def __init__(self, height, title, description, paper):
        self.height = math.ceil(height / PIXEL) * PIXEL  # whole pixels, so that pictures stay sharp
        self.title, self.description = title, description
        self.figure = Figure(figsize=(WIDTH / 72, self.height / 72), dpi=DPI, frameon=False)
        FigureCanvasAgg(self.figure)
        self.axes = self.figure.add_axes([0, 0, 1, 1], frameon=False)
        self.axes.set(xlim=(0, WIDTH), ylim=(0, self.height), xticks=[], yticks=[])
        self.ids = Counter()
        self.panels, self.missing = [], []
        self.card = "#ffffff" if paper else CARD
        # An opaque card: GitHub shows it on black as well as on white, and ink would vanish on one of them.
        self.box(0, 0, WIDTH, self.height, self.card, "card", rounding=0 if paper else 6)

    def add(self, artist, name=None, order=1):
        """Adds an artist. Names become ids in the SVG, where each may occur once."""
        if name:
            name = re.sub(r"[^\w:.-]+", "-", name)[:80]
            self.ids[name] += 1
            artist.set_gid(name if self.ids[name] == 1 else f"{name}:{self.ids[name]}")
        artist.set_zorder(order)
        self.axes.add_artist(artist)
        artist.set_clip_on(False)
        return artist

    def text(self, x, y, text, size=SMALL, colour=INK, weight="normal", align="left", name="text",
             maths=False, halo=False, style="normal"):
        """Writes on the baseline y."""
        artist = Text(x, y, text, color=colour, fontproperties=font(size, weight, style))
        artist.set(ha=align, va="baseline")
        artist.set_parse_math(maths)
        if halo:
            artist.set_path_effects([withStroke(linewidth=2.2, foreground=self.card)])
        return self.add(artist, name, 10)

    def line(self, xs, ys, colour=INK, width=0.6, name=None, order=2, dashes=(0, ()), **more):
        return self.add(Line2D(xs, ys, color=colour, lw=width, ls=dashes, solid_capstyle="butt", **more),
                        name, order)

    def points(self, xs, ys, style, size, name, order=6):
        """Markers without a line. A thin edge in the card's colour keeps neighbours apart."""
        edge, fill = (self.card, style.colour) if style.filled else (style.colour, self.card)
        width = 1.0 if not style.filled else 0.5 if size > 3 else 0.0
        size *= 1.12 if style.shape in "^v<>pPX*" else 1  # these look smaller than they are
        return self.add(Line2D(xs, ys, ls="none", marker=style.shape, ms=size, mfc=fill, mec=edge, mew=width),
                        name, order)

    def bars(self, segments, colour, name, width=0.9, order=4):
        """Many separate strokes as one artist."""
        xs = [x for x1, _, x2, _ in segments for x in (x1, x2, math.nan)]
        ys = [y for _, y1, _, y2 in segments for y in (y1, y2, math.nan)]
        return self.line(xs, ys, colour, width, name, order)

    def box(self, x, y, width, height, colour, name=None, order=1, edge="none", line=0.0, rounding=0.0):
        shape = Rectangle((x, y), width, height)
        if rounding:
            shape = FancyBboxPatch((x, y), width, height, f"round,pad=0,rounding_size={rounding}")
        shape.set(fc=colour, ec=edge, lw=line)
        return self.add(shape, name, order)

    def picture(self, x, y, width, height, pixels, name):
        artist = AxesImage(self.axes, extent=(x, x + width, y, y + height), interpolation="nearest",
                           resample=False)
        artist.set_data(pixels)
        return self.add(artist, name, 3)

    def svg(self):
        file = io.StringIO()
        self.figure.savefig(file, format="svg", metadata={"Date": None, "Creator": None})
        svg = file.getvalue()
        end = re.search(r"<svg [^>]*", svg).end()
        words = [text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
                 for text in (self.title, self.description)]
        head = f' role="img">\n <title>{words[0]}</title>\n <desc>{words[1]}</desc>'
        return (svg[:end] + head + svg[end + 1:]).encode()

    def png(self):
        file = io.BytesIO()
        self.figure.savefig(file, format="png", dpi=DPI, metadata={"Software": None})
        return file.getvalue()


# --- scales

RAIL, GAP, PAD = 12.0, 4.0, 7.0


class Scale:
    """Takes values to points along an axis: [rail] gap main part gap [rail]."""

    def __init__(self, values, log, length, what):
        if log and any(value < 0 for value in values):
            raise Refused(f"{what}: {plain(min(values))} is negative, and the axis is logarithmic")
        self.log, self.length = log, length
        low = any(value == 0 if log else value == -math.inf for value in values)
        high = any(value == math.inf for value in values)
        self.rails = [(RAIL / 2, "0" if log else "−∞")] if low else []
        self.rails += [(length - RAIL / 2, "∞")] if high else []
        self.has_low, self.has_high = low, high
        self.start = RAIL + GAP if low else 0.0
        self.stop = length - (RAIL + GAP if high else 0.0)
        shown = [self.straight(value) for value in values
                 if math.isfinite(value) and not (log and value == 0)]
        self.low, self.high = (min(shown), max(shown)) if shown else (0.0, 1.0)
        # A spread of nothing but noise is not blown up.
        least = 0.3 if log else max(abs(self.low) * 1e-3, 1e-300)
        if self.high - self.low < least:
            middle, half = (self.low + self.high) / 2, least / 2
            if not log and middle == 0:
                half = 0.5
            self.low, self.high = middle - half, middle + half

    def straight(self, value):
        return math.log10(value) if self.log else value

    def along(self, straight):
        inner = self.stop - self.start - 2 * PAD
        return self.start + PAD + (straight - self.low) / (self.high - self.low) * inner

    def place(self, value):
        """Where a value stands. What has no rail here (the end of a bar) goes to the main part's edge."""
        if value == math.inf:
            return self.length - RAIL / 2 if self.has_high else self.stop
        if value == -math.inf or (self.log and value == 0):
            return RAIL / 2 if self.has_low else self.start
        return self.along(self.straight(value))

    def edges(self):
        """Where the rails and the main part begin and end."""
        low = [RAIL, self.start] if self.has_low else []
        return low + ([self.stop, self.length - RAIL] if self.has_high else [])

    def ticks(self, spacing):
        """The labelled ticks, as (points, text, whether it is mathematics), and the points of the others."""
        unit = (self.stop - self.start - 2 * PAD) / (self.high - self.low)  # a decade's length, or that of 1
        reach = PAD / unit
        low, high = self.low - reach, self.high + reach
        if not self.log:
            round_ones = round_values(low, high, spacing / unit)
            return [(self.along(value), text, False) for value, text in round_ones], []
        decades = range(math.ceil(low), math.floor(high) + 1)
        if len(decades) < 4 and unit * 0.47 > spacing:  # room for 1, 2 and 5, or for 1 and 3
            some = powers((1, 2, 5) if unit * 0.3 > spacing else (1, 3), low, high)
            if len(some) >= 2:
                short = all(-5 < k < 5 for _, k in some)
                return ([(self.along(math.log10(m) + k), *power_text(m, k, short)) for m, k in some],
                        self.between(low, high))
        if len(decades) < 2 and -300 < low and high < 300:
            span = 10 ** high - 10 ** low
            ticks = []
            for value, text in round_values(10 ** low, 10 ** high, span * spacing / (unit * (high - low))):
                at = self.along(math.log10(value)) if value > 0 else -math.inf
                if at - (ticks[-1][0] if ticks else -1e9) > spacing * 0.6:
                    ticks.append((at, text, False))
            return ticks, []
        step = next((step for step in (1, 2, 3, 5, 10, 20, 50, 100, 200) if step * unit >= spacing), 500)
        labelled = [k for k in decades if k % step == 0]
        if len(labelled) < 2:
            labelled = list(decades[::step])
        short = all(-2 <= k <= 3 for k in labelled)
        texts = [(self.along(k), *power_text(1, k, short)) for k in labelled]
        return texts, self.between(low, high) if step == 1 and unit > 20 else [self.along(k) for k in decades]

    def between(self, low, high):
        return [self.along(math.log10(m) + k) for m, k in powers(range(1, 10), low, high)]


def powers(mantissas, low, high):
    """The (m, k) for which m·10^k lies between 10^low and 10^high, in order."""
    return [(m, k) for k in range(math.floor(low), math.ceil(high) + 1) for m in mantissas
            if low <= math.log10(m) + k <= high]


def ticks_across(scale):
    """The ticks of an x axis, as far apart as their texts need. A text that hangs over the panel's sides
    would meet the next panel's and is left out."""
    spacing = max(30.0, scale.length / 8)
    while True:
        ticks, minor = scale.ticks(spacing)
        widths = [width_of(text, SMALL, "normal", maths) for _, text, maths in ticks]
        gaps = [b[0] - a[0] - (v + w) / 2 for a, b, v, w in zip(ticks, ticks[1:], widths, widths[1:])]
        if min(gaps, default=9.0) >= 6 or spacing > scale.length:
            break
        spacing *= 1.3
    return [(at, text if -6 <= at - width / 2 and at + width / 2 <= scale.length + 6 else "", maths)
            for (at, text, maths), width in zip(ticks, widths)], minor


def power_text(mantissa, exponent, short):
    """m·10^k as a tick's text, short or as a power of ten, and whether it is mathematics."""
    if short:
        return f"{mantissa * 10.0 ** exponent:.{max(0, -exponent)}f}", False
    return ("$10^{%d}$" % exponent if mantissa == 1 else r"$%d{\cdot}10^{%d}$" % (mantissa, exponent)), True


def round_values(low, high, spacing):
    """Round numbers from low to high, at least a spacing apart, and their texts."""
    power = math.floor(math.log10(spacing)) if spacing > 0 else 0
    step = next(m * 10.0 ** power for m in (1, 2, 5, 10) if m * 10.0 ** power >= spacing or m == 10)
    first = math.ceil(low / step - 1e-9)
    return [(i * step, plain(float(f"{i * step:.12g}")).replace("-", "−"))
            for i in range(first, min(math.floor(high / step + 1e-9), first + 50) + 1)]


# --- the Pareto front


def pareto_front(points):
    """The indices of the points (x, y) that no other beats: none is at most as large in both and smaller in
    one. In the order of x. What is infinite or not a number is no achievement and never on the front."""
    order = sorted((x, y, i) for i, (x, y) in enumerate(points) if math.isfinite(x) and math.isfinite(y))
    front, last = [], None
    for x, y, i in order:
        if last is None or y < last[1] or (x, y) == last:
            front.append(i)
            last = (x, y)
    return front


# --- where labels go

CROWD = 400  # with more points in a panel nothing is labelled beside them

# Around a point: close by, then on rings, there with a leader line.
CLOSE = [(1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (1, -1), (-1, 1), (-1, -1)]
RADII = (9, 15, 22, 30, 39, 49, 60, 72, 85, 100)
RINGS = [(radius, 2 * math.pi * i / 24) for radius in RADII for i in range(24)]


def overlaps(boxes, others):
    """For each of boxes whether it meets one of others; both are rows of x1, y1, x2, y2."""
    if len(others) == 0:
        return np.zeros(len(boxes), bool)
    a, b = np.asarray(boxes)[:, None, :], np.asarray(others)[None, :, :]
    return ((a[..., 0] < b[..., 2]) & (b[..., 0] < a[..., 2]) & (a[..., 1] < b[..., 3]) &
            (b[..., 1] < a[..., 3])).any(1)


def crosses(boxes, segments):
    """For each of boxes whether a segment x1, y1, x2, y2 meets it: no axis separates the two."""
    if len(segments) == 0:
        return np.zeros(len(boxes), bool)
    b, s = np.asarray(boxes)[:, None, :], np.asarray(segments)[None, :, :]
    ex, ey = (b[..., 2] - b[..., 0]) / 2, (b[..., 3] - b[..., 1]) / 2
    dx, dy = (s[..., 2] - s[..., 0]) / 2, (s[..., 3] - s[..., 1]) / 2
    mx = (s[..., 0] + s[..., 2] - b[..., 0] - b[..., 2]) / 2
    my = (s[..., 1] + s[..., 3] - b[..., 1] - b[..., 3]) / 2
    return ((np.abs(mx) <= ex + np.abs(dx)) & (np.abs(my) <= ey + np.abs(dy)) &
            (np.abs(dx * my - dy * mx) <= ex * np.abs(dy) + ey * np.abs(dx))).any(1)


def crossed(segment, others):
    """Whether a segment crosses one of others."""
    ax, ay, bx, by = segment
    for cx, cy, dx, dy in others:
        side = lambda px, py, qx, qy, rx, ry: (qx - px) * (ry - py) - (qy - py) * (rx - px)
        if (side(ax, ay, bx, by, cx, cy) * side(ax, ay, bx, by, dx, dy) < 0 and
                side(cx, cy, dx, dy, ax, ay) * side(cx, cy, dx, dy, bx, by) < 0):
            return True
    return False


def nearest_in(box, x, y):
    return min(max(x, box[0]), box[2]), min(max(y, box[1]), box[3])


class Obstacles:
    """What labels of a panel keep off."""

    def __init__(self, area):
        self.area, self.boxes, self.segments, self.soft, self.taken = area, [], [], [], []

    def copy(self):
        copy = Obstacles(self.area)
        copy.boxes, copy.segments = list(self.boxes), list(self.segments)
        copy.soft, copy.taken = list(self.soft), list(self.taken)
        return copy

    def clear(self, x, y, radius, end):
        """Whether a leader may run from a point to an end: past other labels, points and lines."""
        own = [(x - radius - 1, y - radius - 1, x + radius + 1, y + radius + 1)]
        others = self.taken + [box for box in self.boxes if not overlaps(own, [box])[0]]
        if others and crosses(np.array(others), [(x, y, *end)]).any():
            return False
        strange = [segment for segment in self.segments if not crosses(own, [segment])[0]]
        return not crossed((x, y, *end), strange)

    def find(self, width, height, anchors, strangers=(), far=True, aloof=False):
        """A free box for a label, and the anchor it belongs to: (box, anchor, whether it needs a leader), or
        None. Anchors are (x, y, radius, cost), strangers segments. Near a stranger a label would seem to be
        the stranger's: it avoids them, or, if aloof, refuses them."""
        candidates, facts = [], []
        for index, (x, y, radius, cost) in enumerate(anchors):
            for i, (sx, sy) in enumerate(CLOSE):
                pad = radius + 1.5
                if sx and sy:
                    pad *= 0.7
                cx, cy = x + sx * (pad + width / 2), y + sy * (pad + height / 2)
                candidates.append((cx - width / 2, cy - height / 2, cx + width / 2, cy + height / 2))
                facts.append((cost + i * 0.5, index, False))
            for ring, angle in RINGS if far else ():
                cx = x + math.cos(angle) * (ring + radius + width / 2)
                cy = y + math.sin(angle) * (ring + radius + height / 2)
                candidates.append((cx - width / 2, cy - height / 2, cx + width / 2, cy + height / 2))
                facts.append((cost + 8 + ring, index, True))
        if not candidates:
            return None
        boxes = np.array(candidates)
        left, bottom, right, top = self.area
        free = (boxes[:, 0] >= left) & (boxes[:, 1] >= bottom) & (boxes[:, 2] <= right) & (boxes[:, 3] <= top)
        free[free] = ~overlaps(boxes[free], self.boxes)
        free[free] = ~crosses(boxes[free], self.segments)
        costs = np.array([fact[0] for fact in facts])
        costs[free] += 30 * crosses(boxes[free], self.soft)
        if len(strangers) and free.any():
            near = crosses(boxes[free] + [-4, -4, 4, 4], strangers)
            costs[free] += np.where(near, np.inf if aloof else 40, 0)
            free[free] = np.isfinite(costs[free])
        for i in np.argsort(np.where(free, costs, np.inf), kind="stable")[:200]:
            if not free[i]:
                return None
            _, index, leader = facts[i]
            x, y, radius, _ = anchors[index]
            if not leader or self.clear(x, y, radius, nearest_in(boxes[i], x, y)):
                return tuple(boxes[i]), index, leader
        return None

    def take(self, box, leader=None):
        self.boxes.append(box)
        self.taken.append(box)
        if leader:
            self.segments.append(leader)


# --- experiments

Style = namedtuple("Style", "colour dashes shape filled")
# x and y are values, px and py where they stand in the panel; a bar is None or (low, high), there too.
Point = namedtuple("Point", "x y px py x_bar y_bar line style row")


class Styles:
    """Which colour, dashes and shape a line has: the same in every figure of a report."""

    def __init__(self):
        self.order = {}

    def of(self, line, shape=None, filled=True):
        i = self.order.setdefault(line, len(self.order))
        n = len(COLOURS)
        other = i + i // n  # the second round of colours comes with other dashes and shapes
        return Style(COLOURS[i % n], DASHES[other % len(DASHES)], shape or SHAPES[other % len(SHAPES)],
                     filled)


def mark_code(rows, fields):
    """How marks are told apart: the field that decides filled or open (the first with two values), the fields
    that decide the shape, and the values of each."""
    values = {field: list(dict.fromkeys(words_of(row, field) for row in rows)) for field in fields}
    varying = [field for field in fields if len(values[field]) > 1]
    fill = next((field for field in varying if len(values[field]) == 2), None)
    shape = [field for field in varying if field != fill]
    shapes = list(dict.fromkeys(words(row, shape) for row in rows)) if shape else []
    return fill, values.get(fill, []), shape, shapes


class Panel:
    def __init__(self, name, x, y, width, height, rows):
        self.name, self.x, self.y, self.width, self.height, self.rows = name, x, y, width, height, rows
        self.points, self.published, self.floors, self.front, self.labels = [], [], [], [], []


def parts(items, size):
    """Shared out evenly, at most so many at a time."""
    count = max(1, math.ceil(len(items) / size))
    size = max(1, math.ceil(len(items) / count))
    return [items[i:i + size] for i in range(0, len(items), size)]


def numbered(name, count):
    """The names of so many pages, and which of how many each is: nothing where there is one."""
    if count == 1:
        return [(name, "")]
    return [(f"{name}_{i + 1}", f"{i + 1} of {count}") for i in range(count)]


def floors_of(rows, quantity):
    """The floors of the errors on the y axis: values, each once."""
    found = {}
    for row in rows:
        if quantity.split(".")[0] == "error":
            kind = quantity[len("error."):] or row["errors"][0]["kind"]
            floor = error_named(row, kind + "_floor")
            if floor and floor["value"] is not None and math.isfinite(floor["value"]):
                found[floor["value"]] = True
    return list(found)


def published_of(rows, x, y):
    """Published figures: (x, y, by), where None stands for what was not published."""
    found = {}
    for row in rows:
        if row["published"]:
            theirs = {**row, "build_ms": 0.0,  # a published time is that of the whole
                      "errors": row["published"]["errors"],
                      "time_ms": {"median": row["published"]["time_ms"], "q1": None, "q3": None}}
            values = [measure(theirs, quantity) for quantity in (x, y)]
            if any(one and not quantity.startswith("settings.") for one, quantity in zip(values, (x, y))):
                found[tuple(one and one.value for one in values) + (row["published"]["by"],)] = True
    return list(found)


def device_of(document, backends):
    """The machine's parts that a figure's numbers come from."""
    device = document.get("device")
    if not isinstance(device, dict):
        return [str(device)] if device else []
    names = [device.get({"cpu": "cpu", "cuda": "gpu"}.get(backend, backend)) for backend in backends]
    return [str(name) for name in dict.fromkeys(names) if name]


def footer_of(document, rows, backends):
    """Where a figure's numbers come from, in lines."""
    parts = [document["chapter"], *device_of(document, backends)]
    for name in ("revision", "seed"):
        if document.get(name) is not None:
            parts.append(f"{name} {document[name]}")
    repeats = [row["time_ms"]["repeats"] for row in rows if row["time_ms"]]
    repeats = sorted({int(count) for count in repeats if count and math.isfinite(count)})
    if repeats:
        span = str(repeats[0]) if len(repeats) == 1 else f"{repeats[0]}–{repeats[-1]}"
        parts.append(f"{span} repeat{'s' if repeats[-1] > 1 else ''}: medians, quartiles")
    return wrap_parts(parts, INNER)


def row_name(row, experiment):
    fields = experiment["line"] + experiment["panel"] + experiment["mark"]
    return words(row, fields) or row["technique"]


def draw_experiment(report, experiment, styles, paper=False):
    """The sheets of an experiment, as (name, sheet)."""
    rows = [row for row in report["rows"] if row["experiment"] == experiment["rows_of"]]
    code = mark_code(rows, experiment["mark"])
    figures = {}
    for row in rows:
        styles.of(words(row, experiment["line"]))
        figures.setdefault(words(row, experiment["figure"]), []).append(row)
    sheets = []
    for title, members in figures.items():
        name = "_".join([experiment["name"]] +
                        [words_of(members[0], field) for field in experiment["figure"]])
        panels = {}
        for row in members:
            panels.setdefault(words(row, experiment["panel"]), []).append(row)
        pages = parts(list(panels), 15)
        for page, (name, part) in zip(pages, numbered(name, len(pages))):
            here = {key: panels[key] for key in page}
            sheet = draw_figure(report, experiment, title, part, here, members, styles, code, paper)
            sheets.append((name, sheet))
    return sheets


def draw_figure(report, experiment, title, part, panels, all_rows, styles, code, paper):
    """One page: header, keys, panels that share their axes, notes, footer."""
    x, y = experiment["x"], experiment["y"]
    where = f"{report['path']}: {experiment['name']}"

    def style_of(row):
        fill, fills, shape, shapes = code
        return styles.of(words(row, experiment["line"]),
                         SHAPES[shapes.index(words(row, shape)) % len(SHAPES)] if shape else None,
                         not fill or fills.index(words_of(row, fill)) == 0)

    # The axes are shared by all of the figure's pages.
    extents = {"x": [], "y": []}
    for row in all_rows:
        both = measure(row, x["quantity"]), measure(row, y["quantity"])
        if all(both):
            for axis, found in zip("xy", both):
                extents[axis].append(found.value)
                for end in found[1:]:  # a bar that ends at zero or infinity makes no rail
                    if end is not None and math.isfinite(end) and not (experiment[axis]["log"] and end == 0):
                        extents[axis].append(end)
    extents["y"] += floors_of(all_rows, y["quantity"])
    for their_x, their_y, _ in published_of(all_rows, x["quantity"], y["quantity"]):
        extents["x"] += [their_x] if their_x is not None else []
        extents["y"] += [their_y] if their_y is not None else []

    # Sizes, before there is a sheet.
    columns = len(panels) if len(panels) <= 3 else 2 if len(panels) == 4 else 3
    across = math.ceil(len(panels) / columns)
    height = {1: {1: 230, 2: 180, 3: 150}[columns], 2: 140, 3: 118, 4: 108}.get(across, 100)
    y_scale = Scale(extents["y"], y["log"], height, f"{where}.y")
    y_ticks = y_scale.ticks(max(15.0, height / 8))
    left = MARGIN + 6 + max([width_of(text, SMALL, "normal", maths) for _, text, maths in y_ticks[0]] + [8.0])
    gap = 13.0
    lines = list(dict.fromkeys(words(row, experiment["line"]) for rows in panels.values() for row in rows
                               if measure(row, x["quantity"]) and measure(row, y["quantity"])))

    # Names of lines stand beside them; if that does not work out in every panel, in a gutter to the right of
    # each, or further off with a leader; else in a key. Labels are tried on panels that lie at zero and find
    # their place on the sheet afterwards.
    gutter = 16 + max([width_of(line) for line in lines] + [0.0])
    for labelling in ("beside", "gutter", "leaders", "key"):
        aside = gutter if labelling == "gutter" else 0.0
        width = (WIDTH - MARGIN - left - columns * aside - (columns - 1) * gap) / columns
        if labelling == "gutter" and (width < 120 or not experiment["join"]):
            continue
        if labelling == "leaders" and len(panels) > 4:
            continue  # they would be a thicket
        x_scale = Scale(extents["x"], x["log"], width, f"{where}.x")
        layout = []
        for i, (name, rows) in enumerate(panels.items()):
            panel = Panel(name, left + i % columns * (width + aside + gap), 0.0, width, height, rows)
            panel.row, panel.column, panel.bottom = i // columns, i % columns, i + columns >= len(panels)
            fill_panel(panel, experiment, x_scale, y_scale, style_of)
            layout.append(panel)
        labelled, front_labelled = plan_labels(layout, lines, experiment, styles, labelling, x_scale, y_scale)
        if labelled:
            break
    x_ticks = ticks_across(x_scale)
    titled = bool(experiment["panel"])

    missing, names = [], []
    for name, rows in panels.items():
        gone = [row for row in rows if not (measure(row, x["quantity"]) and measure(row, y["quantity"]))]
        missing += gone
        if len(gone) == len(rows) and titled:
            names.append(f"all of {name}")
        else:
            names += [row_name(row, experiment) for row in gone]
    titles = experiment["title"] + (f" · {title}" if title else "") + (f" ({part})" if part else "")
    header = wrap(titles, INNER, 2, 11, "bold")
    notes = wrap(experiment["note"], INNER, 3)
    below = []
    if missing:
        names = ", ".join(dict.fromkeys(names))
        below += wrap(f"{len(missing)} row{'s' if len(missing) > 1 else ''} without a number: {names}", INNER,
                      3)
    hardware = dict.fromkeys((row["published"]["by"], row["published"]["hardware"])
                             for rows in panels.values() for row in rows
                             if row["published"] and row["published"]["hardware"])
    if hardware:
        below += wrap("Published: " + "; ".join(f"{by} on {what}" for by, what in hardware), INNER, 2)
    left_out = [what[len(experiment["rows_of"]) + 2:] for what in report["left_out"]
                if what.startswith(experiment["rows_of"] + ": ")]
    if left_out:
        below += wrap("Left out: " + "; ".join(left_out), INNER, 2)
    backends = list(dict.fromkeys(row["backend"] for rows in panels.values() for row in rows))
    footer = footer_of(report, [row for rows in panels.values() for row in rows], backends)

    keys = []
    if not labelled:
        plain_lines = bool(code[2])  # the shape says something else: show the colour alone
        keys += [("line", line, styles.of(line, "s" if plain_lines else None), "") for line in lines]
    if not front_labelled:
        keys.append(("front", "Pareto front", None, ""))
    fill, fills, shape, shapes = code
    for i, (value, filled) in enumerate(zip(fills, (True, False))):
        keys.append(("mark", value, Style(GREY, None, "o", filled), field_name([fill]) if i == 0 else ""))
    for i, value in enumerate(shapes):
        style = Style(GREY, None, SHAPES[i % len(SHAPES)], True)
        keys.append(("mark", value, style, field_name(shape) if i == 0 else ""))
    if any(panel.published for panel in layout):
        keys.append(("mark", "published", Style(GREY, None, "D", False), ""))
    key_rows = flow([(kind, fit(text, 150), style, fit(group, 100)) for kind, text, style, group in keys],
                    INNER, experiment["join"])

    top = 11 + len(header) * 15 + len(notes) * 11 + len(key_rows) * 13 + 16
    cell = height + (15 if titled else 5)
    bottom = 15 + 14 + len(below) * 11 + 6 + len(footer) * 11 + 7
    total = top + across * cell + (across - 1) * 6 + bottom
    count = sum(len(panel.points) for panel in layout)
    description = (f"{experiment['note']} {y['label']} over {x['label']}; {count} points; "
                   f"lines: {', '.join(lines)}. {' '.join(footer)}").strip()
    sheet = Sheet(total, " ".join(header), description, paper)
    sheet.panels, sheet.missing = layout, missing
    total = sheet.height

    at = total - 11
    for line in header:
        at -= 11
        sheet.text(MARGIN, at, line, 11, INK, "bold", name="title")
        at -= 4
    for line in notes:
        at -= 9
        sheet.text(MARGIN, at, line, SMALL, GREY, name="note")
        at -= 2
    at -= 2
    for row in key_rows:
        at -= 10
        draw_keys(sheet, row, at, experiment["join"])
        at -= 3
    at -= 9
    sheet.text(MARGIN, at, fit(y["label"], INNER), name="y-label")
    first = total - top
    for panel in layout:
        panel.y = first - panel.row * (cell + 6) - cell
        draw_panel(sheet, panel, experiment, x_scale, y_scale, x_ticks, y_ticks, titled)
    at = first - across * cell - (across - 1) * 6 - 15 - 11
    label = fit(x["label"], INNER)
    middle = min((left + WIDTH - MARGIN) / 2, WIDTH - MARGIN - width_of(label) / 2)
    sheet.text(middle, at, label, align="center", name="x-label")
    at -= 5
    for line in below:
        at -= 11
        sheet.text(MARGIN, at, line, SMALL, INK, name="missing")
    at -= 5
    for line in footer:
        at -= 11
        sheet.text(MARGIN, at, line, SMALL, GREY, name="footer")
    return sheet


def fill_panel(panel, experiment, x_scale, y_scale, style_of):
    """Works out where the panel's points, floors and front stand, from its lower left corner."""
    x, y = experiment["x"]["quantity"], experiment["y"]["quantity"]

    def bar(scale, found):
        ends = [end for end in found[1:] if end is not None and not math.isnan(end)]
        if not ends or math.isinf(found.value):
            return None
        ends = [scale.place(end) for end in ends] + [scale.place(found.value)]
        return min(ends), max(ends)

    for row in panel.rows:
        found_x, found_y = measure(row, x), measure(row, y)
        if found_x and found_y:
            at = x_scale.place(found_x.value), y_scale.place(found_y.value)
            bars = bar(x_scale, found_x), bar(y_scale, found_y)
            line = words(row, experiment["line"])
            panel.points.append(Point(found_x.value, found_y.value, *at, *bars, line, style_of(row), row))
    panel.floors = sorted(y_scale.place(value) for value in floors_of(panel.rows, y))
    for px, py, by in published_of(panel.rows, x, y):
        panel.published.append((None if px is None else x_scale.place(px),
                                None if py is None else y_scale.place(py), by))
    if less_is_better(x) and less_is_better(y):
        front = pareto_front([(point.x, point.y) for point in panel.points])
        corners = []
        for i in front:
            point = panel.points[i]
            corners += [(point.px, corners[-1][1] if corners else panel.height), (point.px, point.py)]
        if corners:
            corners.append((panel.width, corners[-1][1]))
        panel.front, panel.front_points = corners, front
    panel.size = 5.2 if len(panel.points) <= 100 else 3.6 if len(panel.points) <= 1000 else 2.2


def pairs(corners):
    return [(*a, *b) for a, b in zip(corners, corners[1:])]


def curves_of(panel):
    """The points that a joined line runs through, in the order of x: one list a line and mark."""
    curves = {}
    for point in panel.points:
        curves.setdefault((point.line, point.style), []).append(point)
    return [sorted(curve, key=lambda point: point.x) for curve in curves.values()]


def obstacles_in(panel, experiment, x_scale, y_scale):
    found = Obstacles((1.0, 1.0, panel.width - 1.0, panel.height - 1.0))
    half = panel.size / 2 + 0.6
    for point in panel.points:
        found.boxes.append((point.px - half, point.py - half, point.px + half, point.py + half))
        if point.x_bar:
            found.segments.append((point.x_bar[0], point.py, point.x_bar[1], point.py))
        if point.y_bar:
            found.segments.append((point.px, point.y_bar[0], point.px, point.y_bar[1]))
    if experiment["join"]:
        for curve in curves_of(panel):
            found.segments += pairs([(point.px, point.py) for point in curve])
    found.segments += [(0, level, panel.width, level) for level in panel.floors]
    for edge in y_scale.edges():  # a label lies on a rail or off it
        found.segments.append((0, edge, panel.width, edge))
    for edge in x_scale.edges():
        found.segments.append((edge, 0, edge, panel.height))
    found.soft += pairs(panel.front)
    for px, py, _ in panel.published:
        if px is not None and py is not None:
            found.boxes.append((px - 4.5, py - 4.5, px + 4.5, py + 4.5))
        elif px is not None:
            found.segments.append((px, 0, px, panel.height))
        else:
            found.segments.append((0, py, panel.width, py))
    return found


def plan_labels(layout, lines, experiment, styles, labelling, x_scale, y_scale):
    """Finds places for the panels' labels. Returns whether all lines have theirs, and whether the front."""
    obstacles = [obstacles_in(panel, experiment, x_scale, y_scale) for panel in layout]
    for panel, found in zip(layout, obstacles):
        if panel.floors and len(panel.points) <= CROWD:
            box = level_label(found, panel.floors[-1], width_of("floor of the reference"), panel.width)
            if box:
                panel.labels.append((box, "floor of the reference", GREY, None, "floor-label"))
                found.take(box)
        for by in dict.fromkeys(by for _, _, by in panel.published):  # once a publication
            text = fit(by, panel.width * 0.8)
            spots = [(px if px is not None else 0.0, py if py is not None else 0.0, 4.5, 0.0)
                     for px, py, other in panel.published if other == by]
            place = found.find(width_of(text) + 1, SMALL, spots)
            if place:
                panel.labels.append((place[0], text, GREY, leader_of(place, spots), "published-label"))
                found.take(place[0], panel.labels[-1][3])

    labelled = len(lines) <= 1
    if labelling != "key" and not labelled:
        plan = plan_gutter if labelling == "gutter" else plan_lines
        planned = [plan(panel, found, lines, labelling == "leaders", experiment["join"], styles)
                   for panel, found in zip(layout, obstacles)]
        labelled = all(labels is not None for labels in planned)
        for panel, found, labels in zip(layout, obstacles, planned):
            for label in labels or []:
                panel.labels.append(label)
                found.take(label[0], label[3])

    fronts = [(panel, found) for panel, found in zip(layout, obstacles) if panel.front]
    for panel, found in fronts:  # once a figure
        if len(panel.points) > CROWD:
            continue
        found.segments += pairs(panel.front)
        found.area = (max(1.0, x_scale.start), max(1.0, y_scale.start), min(panel.width - 1, x_scale.stop),
                      min(panel.height - 1, y_scale.stop))
        spots = [(x1 + t * (x2 - x1), y1 + t * (y2 - y1), 1.0, 0.0 if y1 == y2 else 3.0)
                 for (x1, y1), (x2, y2) in zip(panel.front, panel.front[1:]) for t in (0.2, 0.5, 0.8)]
        found.soft = []
        strangers = [(point.px, point.py) * 2 for point in panel.points]
        place = found.find(width_of("Pareto front") + 1, SMALL, spots, strangers, far=False)
        if place:
            panel.labels.append((place[0], "Pareto front", GREY, None, "pareto-label"))
            return labelled, True
    return labelled, not fronts


def level_label(found, level, width, room):
    """A place along a horizontal line, from its right end; below it only if there is none above."""
    for bottom in (level + 1.5, level - 1.5 - SMALL):
        for i in range(max(0, int((room - width) / 8)) + 1):
            right = room - 2 - i * 8
            box = (right - width, bottom, right, bottom + SMALL)
            if (box[0] >= found.area[0] and box[1] >= found.area[1] and box[3] <= found.area[3] and
                    not overlaps([box], found.boxes)[0] and not crosses([box], found.segments)[0]):
                return box
    return None


def leader_of(place, anchors):
    box, index, leader = place
    if not leader:
        return None
    x, y, radius, _ = anchors[index]
    ex, ey = nearest_in(box, x, y)
    length = math.hypot(ex - x, ey - y)
    if length <= radius + 1:
        return None
    return x + (ex - x) * radius / length, y + (ey - y) * radius / length, ex, ey


def plan_lines(panel, obstacles, lines, far, joined, styles):
    """A label for every line of the panel beside a point of it, or None if one of them finds no place."""
    if len(panel.points) > CROWD:
        return None
    trial = obstacles.copy()
    labels = []
    for line in lines:
        own = [point for point in panel.points if point.line == line]
        if not own:
            continue
        if joined:  # the end of a line is where the eye looks for its name
            own = sorted(own, key=lambda point: -point.x)
        anchors = [(point.px, point.py, panel.size / 2 + 0.6, 4.0 * min(i, len(own) - i) if joined else 0.0)
                   for i, point in enumerate(own[:24])]
        strangers = [(point.px, point.py) * 2 for point in panel.points if point.line != line]
        if joined:
            strangers += [segment for curve in curves_of(panel) if curve[0].line != line
                          for segment in pairs([(point.px, point.py) for point in curve])]
        text = fit(line, panel.width * 0.7)
        place = trial.find(width_of(text) + 1, SMALL, anchors, strangers, far, aloof=joined and not far)
        if not place:
            return None
        leader = leader_of(place, anchors)
        trial.take(place[0], leader)
        labels.append((place[0], text, styles.of(line).colour, leader, "label:" + line))
    return labels


def plan_gutter(panel, obstacles, lines, far, joined, styles):
    """A label for every line to the right of the panel, in the order of the lines' ends, or None."""
    ends = {}
    for point in panel.points:
        if point.line not in ends or point.px >= ends[point.line].px:
            ends[point.line] = point
    order = sorted(ends.values(), key=lambda point: (point.py, point.px))
    if len(order) * 10 > panel.height or len(panel.points) > CROWD:
        return None
    # As near to the ends as their height allows: from below, each as low as it may be; then pushed down.
    levels = [point.py for point in order]
    for i, level in enumerate(levels):
        levels[i] = max(level, levels[i - 1] + 10 if i else 5.0)
    excess = [max(0.0, level - point.py) for level, point in zip(levels, order)]
    levels = [level - max(excess) / 2 for level in levels]
    for i in reversed(range(len(levels))):
        levels[i] = min(levels[i], levels[i + 1] - 10 if i + 1 < len(levels) else panel.height - 5.0)
    lift = max(0.0, 5.0 - levels[0])
    for i, level in enumerate(levels):
        levels[i] = max(level, levels[i - 1] + 10 if i else level + lift)
    labels = []
    for point, level in zip(order, levels):
        x, radius, end = panel.width + 12, panel.size / 2 + 0.6, (panel.width + 10, level)
        if not obstacles.clear(point.px, point.py, radius, end) or crossed(
                (point.px, point.py, *end), [label[3] for label in labels]):
            return None
        length = math.hypot(end[0] - point.px, end[1] - point.py)
        start = (point.px + (end[0] - point.px) * radius / length,
                 point.py + (end[1] - point.py) * radius / length)
        box = (x, level - SMALL / 2, x + width_of(point.line) + 1, level + SMALL / 2)
        labels.append((box, point.line, point.style.colour, (*start, *end), "label:" + point.line))
    return labels


def flow(keys, width, joined):
    """Keys in rows: lists of (x, kind, text, style, group). A group stays in one row if it fits."""
    rows, x, i = [], 0.0, 0
    while i < len(keys):
        end = i + 1
        while end < len(keys) and keys[i][0] == keys[end][0] and not keys[end][3]:
            end += 1
        wides = [(24.0 if kind == "front" or (kind == "line" and joined) else 10.0) + width_of(text) + 12 +
                 (width_of(group + ":") + 5 if group else 0.0) for kind, text, _, group in keys[i:end]]
        if x:
            x += 8
        if not rows or (x + sum(wides) - 12 > width and x > 0):
            rows.append([])
            x = 0.0
        for key, wide in zip(keys[i:end], wides):
            if x + wide - 12 > width and x > 0:
                rows.append([])
                x = 0.0
            rows[-1].append((MARGIN + x, *key))
            x += wide
        i = end
    return rows


def field_name(fields):
    return " and ".join(field.replace("settings.", "").replace("_", " ") for field in fields)


def draw_keys(sheet, row, y, joined):
    for x, kind, text, style, group in row:
        middle = y + 2.9
        if group:
            sheet.text(x, y, group + ":", colour=GREY, name="key:" + group)
            x += width_of(group + ":") + 5
        if kind == "front":
            sheet.line([x, x + 18], [middle, middle], FRONT, 2.2, "key:front")
            x += 24
        elif kind == "mark":
            sheet.points([x + 3.5], [middle], style, 5.2, "key")
            x += 10
        else:
            if joined:
                sheet.line([x, x + 18], [middle, middle], style.colour, 1.3, "key", dashes=style.dashes)
            sheet.points([x + (9 if joined else 3.5)], [middle], style, 5.2, "key")
            x += 24 if joined else 10
        sheet.text(x, y, text, name="key:" + text)


def draw_axes(sheet, panel, x_scale, y_scale, x_ticks, y_ticks):
    left, bottom = panel.x, panel.y
    for tick, _, _ in x_ticks[0]:
        sheet.line([left + tick] * 2, [bottom + y_scale.start, bottom + y_scale.stop], FAINT, 0.5, order=1.5)
    for tick, _, _ in y_ticks[0]:
        sheet.line([left + x_scale.start, left + x_scale.stop], [bottom + tick] * 2, FAINT, 0.5, order=1.5)
    for scale, upright in ((x_scale, False), (y_scale, True)):
        ticks, minor = x_ticks if scale is x_scale else y_ticks
        parts = [(scale.start, scale.stop)]
        for middle, word in scale.rails:
            low, high = middle - RAIL / 2, middle + RAIL / 2
            parts.append((low, high))
            inner = high + GAP / 2 if middle < scale.start else low - GAP / 2  # the break's middle
            name = ("rail:zero:" if word == "0" else "rail:infinity:") + ("y" if upright else "x")
            if upright:
                sheet.box(left, bottom + low, panel.width, RAIL, BAND, name, 1.2)
                if panel.column == 0:
                    sheet.text(left - 5, bottom + middle - 2.9, word, align="right", name="tick")
            else:
                sheet.box(left + low, bottom, RAIL, panel.height, BAND, name, 1.2)
                if panel.bottom:
                    sheet.text(left + middle, bottom - 12, word, align="center", name="tick")
            for shift in (-1.1, 1.1):  # the break: two short slanted strokes
                if upright:
                    at = bottom + inner + shift
                    sheet.line([left - 2.2, left + 2.2], [at - 0.9, at + 0.9], GREY, 0.6)
                else:
                    at = left + inner + shift
                    sheet.line([at - 0.9, at + 0.9], [bottom - 2.2, bottom + 2.2], GREY, 0.6)
        for low, high in parts:
            if upright:
                sheet.line([left, left], [bottom + low, bottom + high], GREY, 0.7)
            else:
                sheet.line([left + low, left + high], [bottom, bottom], GREY, 0.7)
        strokes = [(tick, 1.8) for tick in minor] + [(tick, 3.5) for tick, _, _ in ticks]
        if upright:
            strokes = [(left - length, bottom + tick, left, bottom + tick) for tick, length in strokes]
        else:
            strokes = [(left + tick, bottom - length, left + tick, bottom) for tick, length in strokes]
        sheet.bars(strokes, GREY, None, 0.6, 2)
        for tick, text, maths in ticks:
            if upright and panel.column == 0:
                sheet.text(left - 5, bottom + tick - 2.9, text, align="right", name="tick", maths=maths)
            elif text and not upright and panel.bottom:
                sheet.text(left + tick, bottom - 12, text, align="center", name="tick", maths=maths)


def draw_panel(sheet, panel, experiment, x_scale, y_scale, x_ticks, y_ticks, titled):
    left, bottom = panel.x, panel.y
    if titled:
        name = fit(panel.name or "–", panel.width, 8.5, "bold")
        sheet.text(left, bottom + panel.height + 4, name, 8.5, INK, "bold", name="panel")
    draw_axes(sheet, panel, x_scale, y_scale, x_ticks, y_ticks)
    if panel.front:
        sheet.line([left + x for x, _ in panel.front], [bottom + y for _, y in panel.front], FRONT, 2.2,
                   "pareto", 2.5, solid_joinstyle="miter")
    for level in panel.floors:
        sheet.line([left, left + panel.width], [bottom + level] * 2, GREY, 0.8, "floor", 3, (0, (4, 2.5)))

    if not panel.points:
        sheet.text(left + panel.width / 2, bottom + panel.height / 2, "no number", colour=GREY,
                   align="center", name="empty")
    groups = {}
    for point in panel.points:
        groups.setdefault((point.line, point.style), []).append(point)
    for (line, style), points in groups.items():
        bars = [(p.x_bar[0], p.py, p.x_bar[1], p.py) for p in points if p.x_bar]
        bars += [(p.px, p.y_bar[0], p.px, p.y_bar[1]) for p in points if p.y_bar]
        if bars:
            bars = [(left + x1, bottom + y1, left + x2, bottom + y2) for x1, y1, x2, y2 in bars]
            sheet.bars(bars, style.colour, "bars:" + line, 0.9 if len(panel.points) <= 10 else 0.6)
    if experiment["join"]:
        for curve in curves_of(panel):
            style = curve[0].style
            sheet.line([left + p.px for p in curve], [bottom + p.py for p in curve], style.colour, 1.3,
                       "line:" + curve[0].line, 5, style.dashes)
    for (line, style), points in groups.items():
        sheet.points([left + p.px for p in points], [bottom + p.py for p in points], style, panel.size,
                     "point:" + line)

    for px, py, by in panel.published:
        if px is None or py is None:  # half of it is known: a line, not a made-up point
            xs = [0, panel.width] if px is None else [px, px]
            ys = [0, panel.height] if py is None else [py, py]
            sheet.line([left + x for x in xs], [bottom + y for y in ys], GREY, 0.8, "published:" + by, 3,
                       (0, (1.5, 1.5)))
        diamond = Rectangle((-3, -3), 6, 6, fc="none", ec=GREY, lw=1.0, ls=(0, (1.6, 1.0)))
        where = (left + (px if px is not None else 0.0), bottom + (py if py is not None else 0.0))
        diamond.set_transform(Affine2D().rotate_deg(45).translate(*where) + sheet.axes.transData)
        sheet.add(diamond, "published:" + by, 7)
    for box, text, colour, leader, name in panel.labels:
        if leader:
            x1, y1, x2, y2 = leader
            sheet.line([left + x1, left + x2], [bottom + y1, bottom + y2], colour, 0.5, "leader", 5.5)
        x, y = left + box[0] + 0.5, bottom + box[1] + 0.26 * SMALL
        sheet.text(x, y, text, SMALL, ink(colour), name=name, halo=True)


# --- stability

Cell = namedtuple("Cell", "failures of worst unit by_nature why picture")


def read_stability(path):
    stability = read_json(path)
    need(stability, "chapter", path, str)
    cells, cases = {}, {}
    for i, raw in enumerate(need(stability, "rows", path, list)):
        where = f"{path}: rows[{i}]"
        case, technique = need(raw, "case", where, str), need(raw, "technique", where, str)
        failures, of = need(raw, "failures", where, int), need(raw, "of", where, int)
        worst = raw.get("worst") or {}
        if not isinstance(worst, dict):
            raise Refused(f'{where}: "worst" is not an object')
        key = (str(raw.get("backend") or "cpu"), case, technique)
        if key in cells:
            raise Refused(f"{where}: a second row for {case}, {technique}")
        if not 0 <= failures <= of:
            raise Refused(f"{where}: {failures} failures of {of}")
        cells[key] = Cell(failures, of, number(worst.get("value"), f"{where}.worst.value"),
                          str(worst.get("unit") or ""),
                          raw.get("by_nature") is True, str(raw.get("why") or ""), raw.get("picture"))
        cases[case] = cases.get(case) or str(raw.get("what") or "")
    return {**stability, "path": path, "cells": cells, "cases": cases}


def rate_text(cell):
    if cell.of == 0:
        return "not run"
    if cell.failures == 0:
        return f"0 of {counted(cell.of)}"
    if cell.failures == cell.of:
        return "all"
    if cell.failures / cell.of >= 0.01:
        return f"{min(99.9, 100 * cell.failures / cell.of):.3g} %" if cell.failures / cell.of > 0.99 else \
            f"{100 * cell.failures / cell.of:.2g} %"
    return f"{counted(cell.failures)} of {counted(cell.of)}"


def worst_text(cell, unit=""):
    """The worst error and, unless it is the one that all have, its unit."""
    if cell.worst is None:
        return ""
    return f"{rounded(cell.worst, 2)} {cell.unit if cell.unit != unit else ''}".strip()


ALARM, NATURE = "#b8330e", "#f6e2bf"


def cases_of(stability, backend, wanted=lambda cell: True):
    """The backend's cases and techniques, in the order of the file."""
    keys = [key for key, cell in stability["cells"].items() if key[0] == backend]
    cases = list(dict.fromkeys(case for _, case, _ in keys))
    cases = [case for case in cases if any(wanted(stability["cells"][key]) for key in keys if key[1] == case)]
    return cases, list(dict.fromkeys(technique for _, _, technique in keys))


def sheet_head(title, note, part, paper, height, description):
    """A sheet with its header and footer; returns it and where the next line may stand."""
    sheet = Sheet(height, title, description, paper)
    at = sheet.height - 22
    title = fit(title + (f" ({part})" if part else ""), INNER, 11, "bold")
    sheet.text(MARGIN, at, title, 11, INK, "bold", name="title")
    for line in note:
        at -= 11.5
        sheet.text(MARGIN, at, line, SMALL, GREY, name="note")
    return sheet, at


def draw_footer(sheet, lines):
    for i, line in enumerate(reversed(lines)):
        sheet.text(MARGIN, 10 + 11 * i, line, SMALL, GREY, name="footer")


def paged(cases, height_of):
    """Cases in pages, none of which is too tall (unless a case alone is); height_of takes a page's cases."""
    pages = [[]]
    for case in cases:
        if pages[-1] and height_of(pages[-1] + [case]) > TALLEST:
            pages.append([])
        pages[-1].append(case)
    even = parts(cases, math.ceil(len(cases) / len(pages)))
    return even if all(height_of(page) <= TALLEST for page in even) else pages


class StabilityTable:
    """Some techniques' columns of the table, and how high its rows are."""

    def __init__(self, stability, backend, techniques):
        self.stability, self.backend, self.techniques = stability, backend, techniques
        units = {cell.unit for key, cell in stability["cells"].items()
                 if key[0] == backend and cell.worst is not None}
        self.unit = units.pop() if len(units) == 1 else ""  # which all have, so that no cell need say it
        self.step = {4: 92.0, 5: 77.0}.get(len(techniques), 105.0)
        self.first = INNER - self.step * len(techniques)
        self.footer = footer_of(stability, [], [backend])
        self.note = wrap(
            f"Failures, and below them the worst error{', ' * bool(self.unit)}{self.unit}. Tinted: the "
            "technique fails this case by its nature. Red: it should not fail.", INNER, 2)

    def cells(self, case):
        return [self.stability["cells"].get((self.backend, case, technique)) for technique in self.techniques]

    def names(self, case):
        return wrap(case, self.first - 10, 2, 8.5, "bold")

    def what(self, case):
        return wrap(self.stability["cases"][case], self.first - 10, 4)

    def row_height(self, case):
        lines = [
            len(wrap(worst_text(cell, self.unit), self.step - 18, 2)) for cell in self.cells(case) if cell
        ]
        return 15 + 10 * max([len(self.names(case)) - 1 + len(self.what(case)), 1] + lines)

    def whys(self, cases):
        """The reasons for what fails by nature, each once, as lines."""
        found = dict.fromkeys(cell.why for case in cases for cell in self.cells(case)
                              if cell and cell.by_nature and cell.failures and cell.why)
        return {why: wrap(why, INNER - 14, 2) for why in found}

    def height(self, cases):
        whys = sum(len(lines) for lines in self.whys(cases).values())
        return (22 + 11.5 * len(self.note) + 25 + sum(map(self.row_height, cases)) + 12 + 11 * whys +
                11 * len(self.footer) + 10)

    def draw(self, cases, part, paper):
        whys = self.whys(cases)
        letters = {why: letter_of(k) for k, why in enumerate(whys)}
        failed = sum(
            1 for case in cases for cell in self.cells(case) if cell and cell.failures and not cell.by_nature)
        description = (
            f"{len(cases)} cases, {len(self.techniques)} techniques; {failed} of the cells are failures that "
            f"are not by nature. {' '.join(self.footer)}")
        sheet, at = sheet_head(f"Stability · {machine(self.backend)}", self.note, part, paper,
                               self.height(cases), description)
        at -= 20
        columns = [MARGIN + self.first + k * self.step for k in range(len(self.techniques))]
        for x, technique in zip(columns, self.techniques):
            name = fit(technique, self.step - 8, SMALL, "bold")
            sheet.text(x + 5, at, name, SMALL, INK, "bold", name="technique")
        at -= 5
        sheet.line([MARGIN, WIDTH - MARGIN], [at, at], INK, 0.8)
        for case in cases:
            names, height = self.names(case), self.row_height(case)
            for k, line in enumerate(names):
                sheet.text(MARGIN, at - 11 - 10 * k, line, 8.5, INK, "bold", name="case")
            for k, line in enumerate(self.what(case)):
                sheet.text(MARGIN, at - 11 - 10 * (k + len(names)), line, SMALL, GREY, name="what")
            at -= height
            for x, technique, cell in zip(columns, self.techniques, self.cells(case)):
                draw_cell(sheet, cell, x, at, self.step, height, letters, technique, self.unit)
            sheet.line([MARGIN, WIDTH - MARGIN], [at, at], FAINT, 0.6)
        at -= 6
        for why, lines in whys.items():
            sheet.text(MARGIN, at - 11, letters[why], SMALL, INK, "bold", name="why")
            for line in lines:
                at -= 11
                sheet.text(MARGIN + 14, at, line, SMALL, INK, name="why")
        draw_footer(sheet, self.footer)
        return sheet


def draw_stability(stability, backend, paper=False):
    """The table of failures on a backend: cases down, techniques across; as (name, sheet)."""
    cases, techniques = cases_of(stability, backend)
    tables = [
        StabilityTable(stability, backend, block)
        for block in parts(techniques, 5 if len(techniques) == 5 else 4)
    ]
    pages = [(table, page) for table in tables for page in paged(cases, table.height)]
    return [(name, table.draw(page, part, paper))
            for (table, page), (name, part) in zip(pages, numbered(f"stability_{backend}", len(pages)))]


def letter_of(i):
    return chr(ord("a") + i % 26) * (1 + i // 26)


def draw_cell(sheet, cell, x, y, width, height, letters, technique, unit):
    top = y + height - 11
    if cell is None:
        sheet.text(x + 5, top, "–", colour=GREY, name="cell")
        return
    colour, weight, text, second = GREY, "normal", rate_text(cell), worst_text(cell, unit)
    loud = cell.failures > 0 and not cell.by_nature
    if loud:
        sheet.box(x + 1, y + 1.5, width - 2, height - 3, ALARM, f"alarm:{technique}", 1.2)
        colour, weight, text = "#ffffff", "bold", "✗ " + text
    elif cell.failures:
        sheet.box(x + 1, y + 1.5, width - 2, height - 3, NATURE, f"nature:{technique}", 1.2)
        colour = INK
        longer = text + " · by nature"
        text = longer if width_of(longer, 8.5) <= width - 9 else text
    letter = letters.get(cell.why) if cell.failures and cell.by_nature else None
    sheet.text(x + 5, top, fit(text, width - 9, 8.5, weight), 8.5, colour, weight, name="cell")
    if letter:
        sheet.text(x + width - 5, top - 10, letter, SMALL, INK, "bold", "right", name="cell")
    for k, line in enumerate(wrap(second, width - 18, 2)):
        sheet.text(x + 5, top - 10 - 10 * k, line, SMALL, "#ffffff" if loud else colour, name="cell")


def load_picture(directory, path):
    """A picture of a failure as an array; or, as texts, what stands in its place and what is wrong."""
    if not path:
        return "no picture", ""
    path = os.path.join(directory, str(path))
    try:
        with open(path, "rb") as file:
            return imread(file, format="png")
    except Exception as error:  # whatever the PNG reader throws: the rest is worth more than the picture
        return "picture not here", f"{path}: {getattr(error, 'strerror', None) or error}".splitlines()[0]


class ContactSheet:
    """The pictures of the cases that a technique fails, side by side, and how high its rows are."""

    def __init__(self, stability, backend):
        self.stability, self.backend = stability, backend
        self.cases, techniques = cases_of(stability, backend, lambda cell: cell.failures > 0)
        self.techniques = {
            case: [technique for technique in techniques if (backend, case, technique) in stability["cells"]
                  ] for case in self.cases
        }
        directory = os.path.dirname(stability["path"])
        self.pictures = {(case, technique): load_picture(directory, stability["cells"][backend, case,
                                                                                       technique].picture)
                         for case in self.cases for technique in self.techniques[case]}
        self.across = min(4, max(1, len(techniques)))
        self.place = 256 * PIXEL
        self.step = self.place + 4
        self.first = INNER - 4 * self.step
        self.footer = footer_of(stability, [], [backend])

    def names(self, case):
        return wrap(case, self.first - 6, 2, 8.5, "bold")

    def what(self, case):
        return wrap(self.stability["cases"][case], self.first - 6, 7)

    def picture_height(self, case):
        return max(size_of(self.pictures[case, technique])[1] for technique in self.techniques[case]) or 60.0

    def row_height(self, case):
        rows = math.ceil(len(self.techniques[case]) / self.across)
        return max(rows * (self.picture_height(case) + 27) + 8,
                   22 + 11 * len(self.names(case)) + 10 * len(self.what(case)))

    def height(self, cases):
        return 22 + 11.5 + 14 + sum(map(self.row_height, cases)) + 11 * len(self.footer) + 10

    def draw(self, cases, part, paper):
        note = ["The cases in which a technique fails, pixel by pixel. Red: not by its nature."]
        sheet, at = sheet_head(f"What failures look like · {machine(self.backend)}", note, part, paper,
                               self.height(cases), f"{len(cases)} cases. {' '.join(self.footer)}")
        at -= 10
        for case in cases:
            sheet.line([MARGIN, WIDTH - MARGIN], [at, at], FAINT, 0.6)
            below = at - 14
            for line in self.names(case):
                sheet.text(MARGIN, below, line, 8.5, INK, "bold", name="case")
                below -= 11
            for line in self.what(case):
                sheet.text(MARGIN, below, line, SMALL, GREY, name="what")
                below -= 10
            height = self.picture_height(case)
            for k, technique in enumerate(self.techniques[case]):
                # On whole pixels, or else the print would blur the picture's own.
                x = math.ceil((MARGIN + self.first + k % self.across * self.step) / PIXEL) * PIXEL
                y = math.floor((at - 5 - k // self.across * (height + 27) - height) / PIXEL) * PIXEL
                self.draw_picture(sheet, case, technique, x, y, height)
            at -= self.row_height(case)
        draw_footer(sheet, self.footer)
        return sheet

    def draw_picture(self, sheet, case, technique, x, y, room):
        """A picture, or a word in its place, at the top of a room so high; below it, whose, and the rate."""
        cell, pixels = self.stability["cells"][self.backend, case, technique], self.pictures[case, technique]
        loud = cell.failures > 0 and not cell.by_nature
        sheet.text(x, y - 9.5, fit(technique, self.place, SMALL, "bold"), SMALL, INK, "bold",
                   name="technique")
        colour, weight = (ALARM, "bold") if loud else (INK if cell.failures else GREY, "normal")
        rate = fit(("✗ " if loud else "") + rate_text(cell), self.place, SMALL, weight)
        sheet.text(x, y - 19.5, rate, SMALL, colour, weight, name="rate")
        if isinstance(pixels, tuple):
            sheet.box(x, y, self.place, room, BAND, "placeholder", 1.2)
            sheet.text(x + self.place / 2, y + room / 2 - 3, pixels[0], SMALL, GREY, align="center",
                       name="placeholder")
            return
        width, height = size_of(pixels)
        factor = 256 // max(pixels.shape[:2])
        if factor:
            pixels = np.repeat(np.repeat(pixels, factor, 0), factor, 1)
        if pixels.ndim == 2:
            pixels = np.repeat(pixels[:, :, None], 3, 2)
        sheet.picture(x, y + room - height, width, height, pixels, f"picture:{technique}")
        if loud:
            sheet.box(x, y + room - height, width, height, "none", f"alarm:{technique}", 4, ALARM, 1.6)


def size_of(pixels):
    """A picture's width and height on paper: enlarged by a whole factor, to at most 256 pixels."""
    if isinstance(pixels, tuple):
        return 0.0, 0.0
    height, width = pixels.shape[:2]
    unit = PIXEL * (256 // max(height, width) or 256 / max(height, width))
    return width * unit, height * unit


def draw_failures(stability, backend, paper=False):
    """The contact sheets of a backend's failures, as (name, sheet); none where there is no picture."""
    contact = ContactSheet(stability, backend)
    absent = [picture for picture in contact.pictures.values() if isinstance(picture, tuple)]
    wrong = [reason for _, reason in absent if reason]
    if wrong:
        print(f"warning: {len(wrong)} picture{'s are' if len(wrong) > 1 else ' is'} missing: {wrong[0]}"
              f"{' …' if len(wrong) > 1 else ''}", file=sys.stderr)
    if len(absent) == len(contact.pictures):
        return []
    pages = paged(contact.cases, contact.height)
    return [(name, contact.draw(page, part, paper))
            for page, (name, part) in zip(pages, numbered(f"failures_{backend}", len(pages)))]


# --- tables


def escaped(text):
    """A text for GitHub's Markdown, in which nothing is markup."""
    text = text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
    return re.sub(r"([\\|`*_$~\[\]#!])", r"\\\1", text).strip()


def table(names, lines, right):
    """A Markdown table; the columns in right stand to the right."""
    rows = ["| " + " | ".join(escaped(name) for name in names) + " |",
            "| " + " | ".join("---:" if name in right else "---" for name in names) + " |"]
    return "\n".join(rows + ["| " + " | ".join(cells) + " |" for cells in lines]) + "\n"


def spread(value, low, high):
    if None in (value, low, high) or low == high:
        return rounded(value)
    return f"{rounded(value)} [{rounded(low)}–{rounded(high)}]"


def experiment_table(report, plots):
    """The rows that some plots share, all of them."""
    rows = [row for row in report["rows"] if row["experiment"] == plots[0]["rows_of"]]
    # As columns: the fields that the plots name, then what else differs.
    fields = [field for plot in plots for field in plot["figure"] + plot["panel"]] + ["technique"]
    fields = list(dict.fromkeys(fields + [field for plot in plots for field in plot["line"] + plot["mark"]]))
    names = dict.fromkeys(name for row in rows for name in row["settings"])
    for field in ["scene", "backend"] + [f"settings.{name}" for name in names]:
        if field not in fields and len({words_of(row, field) for row in rows}) > 1:
            fields.append(field)
    kinds = list(dict.fromkeys(error["kind"] for row in rows for error in row["errors"]))
    built = any(row["build_ms"] is not None for row in rows)
    theirs = any(row["published"] for row in rows)
    numbers = ["time, ms [q1–q3]"] + (["build, ms"] if built else [])
    numbers += [kind.replace("_", " ") for kind in kinds] + ["bytes"]
    heads = [field.replace("settings.", "") for field in fields] + numbers + (["published"] if theirs else [])
    lines = []
    for row in rows:
        cells = []
        for field in fields:
            value = row["settings"].get(field[9:]) if field.startswith("settings.") else None
            bare = isinstance(value, (int, float)) and not isinstance(value, bool)  # the column names it
            cells.append(escaped(plain(value) if bare else words_of(row, field)))
        time = row["time_ms"]
        cells.append(spread(time["median"], time["q1"], time["q3"]) if time else "–")
        if built:
            cells.append(rounded(row["build_ms"]))
        for kind in kinds:
            error = error_named(row, kind)
            cells.append(spread(error["value"], error["low"], error["high"]) if error else "–")
        cells.append(rounded(row["bytes"]))
        if theirs:
            cells.append(escaped(published_text(row["published"])) if row["published"] else "–")
        lines.append(cells)
    heads_of = [f"*{escaped(plot['title'])}.* {escaped(plot['note'])}".rstrip() for plot in plots]
    head = f"## {escaped(plots[0]['rows_of'])}\n\n" + "\n\n".join(heads_of) + "\n\n"
    return head + (table(heads, lines, set(numbers)) if rows else "No rows.\n")


def published_text(one):
    facts = [f"{rounded(one['time_ms'])} ms"] if one["time_ms"] is not None else []
    facts += [f"{error['kind']} {rounded(error['value'])}" for error in one["errors"]]
    return ", ".join(facts + [" on ".join(filter(None, (one["by"], one["hardware"])))])


def stability_table(stability):
    out = ["## Stability\n"]
    for backend in dict.fromkeys(key[0] for key in stability["cells"]):
        cases, techniques = cases_of(stability, backend)
        lines, whys = [], {}
        for case in cases:
            cells = [escaped(": ".join(filter(None, (case, stability["cases"][case]))))]
            for technique in techniques:
                cell = stability["cells"].get((backend, case, technique))
                if cell is None:
                    cells.append("–")
                    continue
                text = rate_text(cell) + (f"; {escaped(worst_text(cell))}" if worst_text(cell) else "")
                if cell.failures and cell.by_nature:
                    letter = whys.setdefault(cell.why, letter_of(len(whys))) if cell.why else ""
                    text += f" (by nature{', ' + letter if letter else ''})"
                cells.append(f"**{text}**" if cell.failures and not cell.by_nature else text)
            lines.append(cells)
        out.append(
            f"{escaped(machine(backend))}: failures; the worst error. Bold: not by the technique's nature.\n")
        out.append(table(["case"] + techniques, lines, set()))
        if whys:
            out.append("\n".join(f"- {letter}: {escaped(why)}" for why, letter in whys.items()) + "\n")
    return "\n".join(out)


# --- the program


def slug(text):
    """A file's name: letters, digits, _ and -."""
    return re.sub(r"[^A-Za-z0-9_-]+", "_", text).strip("_-")[:80] or "figure"


def draw_all(directory, paper):
    """Every file of a report, as a dictionary from its name to its bytes."""
    paths = [os.path.join(directory, name) for name in ("report.json", "stability.json")]
    report = read_report(paths[0]) if os.path.exists(paths[0]) or not os.path.exists(paths[1]) else None
    stability = read_stability(paths[1]) if os.path.exists(paths[1]) else None
    first = report or stability
    facts = [f"chapter {first['chapter']}", *device_of(first, ["cpu", "cuda"])]
    facts += [f"{name} {first[name]}" for name in ("revision", "seed") if first.get(name) is not None]
    files, tables = {}, [f"# {escaped(str(first.get('title') or first['chapter']))}: tables\n",
                         escaped(" · ".join(facts)) + ". Numbers to three digits; "
                         "in brackets the quartiles of times and the bounds of errors.\n"]

    def keep(sheets):
        for name, sheet in sheets:
            free = base = slug(name).lower()
            count = 1
            while free + ".svg" in files:
                count += 1
                free = f"{base}_v{count}"
            files[free + ".svg"], files[free + ".png"] = sheet.svg(), sheet.png()

    if stability:
        for backend in dict.fromkeys(key[0] for key in stability["cells"]):
            keep(draw_stability(stability, backend, paper))
            keep(draw_failures(stability, backend, paper))
    if report:
        styles = Styles()
        for experiment in report["experiments"]:
            sheets = draw_experiment(report, experiment, styles, paper)
            if not sheets:
                print(f"warning: {paths[0]}: {experiment['name']} has no rows and is not drawn",
                      file=sys.stderr)
            keep(sheets)
        for name in dict.fromkeys(experiment["rows_of"] for experiment in report["experiments"]):
            tables.append(
                experiment_table(report, [one for one in report["experiments"] if one["rows_of"] == name]))
        if report["left_out"]:
            tables.append("## Left out\n\n" + "".join(f"- {escaped(what)}\n" for what in report["left_out"]))
    if stability:
        tables.append(stability_table(stability))
    files["tables.md"] = "\n".join(tables).encode()
    return files


def write_all(files, directory):
    """Writes all files or none: into a folder beside their place first."""
    try:
        os.makedirs(directory, exist_ok=True)
        scratch = tempfile.mkdtemp(prefix=".plot.", dir=directory)
        try:
            for name, content in files.items():
                with open(os.path.join(scratch, name), "wb") as file:
                    file.write(content)
            for name in files:
                os.replace(os.path.join(scratch, name), os.path.join(directory, name))
        finally:
            shutil.rmtree(scratch, ignore_errors=True)
    except OSError as error:
        raise Refused(f"{error.filename or directory}: {error.strerror}") from None


class Parser(argparse.ArgumentParser):
    def error(self, message):
        self.exit(2, f"error: {message}; usage: plot.py DIR [--out DIR] [--print]\n")


def main(arguments=None):
    parser = Parser(prog="plot.py", description="Draws the experiments of DIR/report.json and the table of "
                    "DIR/stability.json as SVG and PNG, and writes all numbers to tables.md.")
    parser.add_argument("directory", metavar="DIR", help="the folder of the report")
    parser.add_argument("--out", metavar="DIR", help="where the files go; the report's folder if not given")
    parser.add_argument("--print", dest="paper", action="store_true",
                        help="for paper: a white page instead of a card")
    options = parser.parse_args(arguments)
    directory = options.directory.rstrip("/") or "/"
    out = options.out or directory
    try:
        files = draw_all(directory, options.paper)
        write_all(files, out)
    except Refused as refusal:
        print(" ".join(f"error: {refusal}".split()), file=sys.stderr)
        return 1
    for name in files:
        print(os.path.join(out, name))
    return 0


if __name__ == "__main__":
    sys.exit(main())
