#!/usr/bin/python3
"""The figures of reports: what is drawn where, and what is refused. Every test says what it would catch."""

import contextlib
import functools
import importlib.util
import io
import itertools
import json
import math
import os
import random
import subprocess
import sys
import tempfile
import time
import unittest
import xml.etree.ElementTree as ElementTree

try:
    import matplotlib.image
    import numpy as np
except ImportError as missing:
    print(f"TRILHA SKIPPED: {missing}")
    sys.exit(0)

SCRIPT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "../../common/report/plot.py")
sys.dont_write_bytecode = True
spec = importlib.util.spec_from_file_location("plot", SCRIPT)
plot = importlib.util.module_from_spec(spec)
spec.loader.exec_module(plot)

INF, NAN = "Infinity", "NaN"


def row(x=1.0, y=1.0, technique="plane", scene="bunny", backend="cpu", settings=None, experiment="e", **more):
    """A row of a report with a time of x and an error of y."""
    time = {"median": x, "q1": x * 0.9, "q3": x * 1.2, "repeats": 5} if isinstance(x, float) else \
        {"median": x, "q1": x, "q3": x, "repeats": 5}
    error = {"kind": "rmse", "value": y, "low": None, "high": None}
    return {
        "experiment": experiment, "scene": scene, "backend": backend, "technique": technique,
        "settings": settings or {}, "time_ms": time, "error": error, "errors": [error], "build_ms": 2.0,
        "rays": 1e6, "mrays_per_s": 1.0, "node_visits": 0, "primitive_tests": 1e6, "bytes": 1000, **more
    }


def experiment(name="e", x="time_ms", y="error", **more):
    x, y = ({"quantity": axis, "label": f"the {axis}"} if isinstance(axis, str) else axis for axis in (x, y))
    return {
        "name": name, "title": f"About {name}", "note": "A note.", "x": x, "y": y, "figure": ["backend"],
        "panel": ["scene"], "line": ["technique"], "mark": [], "join": False, **more
    }


def report(rows, experiments=None):
    return {
        "chapter": "01_ray_casting", "title": "Ray casting", "revision": "57a71c8",
        "device": {"cpu": "A processor with a long name, 2 threads", "gpu": "NVIDIA H100 80GB HBM3"},
        "seed": 0, "experiments": [experiment()] if experiments is None else experiments, "rows": rows
    }


TESTS = ["plane", "moller-trumbore", "baldwin-weber", "watertight"]


def chapter_one(seed):
    """Like chapter 01's report: sets × tests × float or double × loops; times over triangles; errors over time."""
    draw = random.Random(seed)
    rows = []
    sets = ["random", "slivers 1e7", "grazing", "far 1e5", "size 1e-18", "edges", *"abcdef"]
    for scene, test, scalar, loop in itertools.product(sets, TESTS, ["float", "double"], ["plain", "blocked"]):
        odd = [0, INF] if scene in ("edges", "size 1e-18") else []
        error = draw.choice(odd + [3.0, 10 ** draw.uniform(-9, 6)])
        rows.append(
            row(10 ** draw.uniform(0, 1.5), error, test, scene, settings={"scalar": scalar, "loop": loop},
                experiment="tests"))
    for backend, test, k in itertools.product(["cpu", "cuda"], TESTS, range(7)):
        rows.append(
            row(10 ** (0.5 * k + draw.uniform(0, 0.4)), 0, test, "random", backend,
                {"triangles": int(10 ** (2 + k / 2))}, "triangles"))
    for scene, test, k in itertools.product(["bunny", "teaset"], TESTS, range(8)):
        one = row(300.0 * 2 ** k * draw.uniform(0.95, 1.3), 0.1 * 2 ** (-k / 2) * draw.uniform(0.97, 1.03),
                  test, scene, experiment="samples")
        one["errors"] = [one["error"], {"kind": "rmse_floor", "value": 0.004}]
        if (test, k) == ("plane", 0):
            one["published"] = {
                "time_ms": 900.0, "error": 0.02 if scene == "bunny" else None, "by": "Somebody 2010",
                "hardware": "a GTX 280"
            }
        rows.append(one)
    return report(rows, [
        experiment("tests", "ns_per_test", "error.rmse", mark=["settings.scalar", "settings.loop"]),
        experiment("triangles", "settings.triangles", "time_ms", figure=[], panel=["backend"], join=True),
        experiment("samples", "total_ms", "error.rmse", join=True)])


def stability(cases=25, techniques=TESTS, seed=1):
    draw, rows = random.Random(seed), []
    for i, technique in itertools.product(range(cases), techniques):
        failures = draw.choice([0, 0, 0, 0, 7, 4096])
        name = f"case {i}" + " and a name that takes two lines" * (i % 4 == 3)
        rows.append({
            "case": name, "what": "a case of a kind " * (i % 4), "technique": technique,
            "backend": "cpu", "failures": failures, "of": 4096,
            "worst": {"value": draw.choice([0.3, INF, None, 1e7]), "unit": "of its bound"},
            "by_nature": failures > 0 and i % 5 > 0, "why": f"because of reason {i % 3}"
        })
    return {
        "chapter": "01_ray_casting", "revision": "57a71c8", "device": {"cpu": "A processor", "gpu": None},
        "rows": rows
    }


class Folder(tempfile.TemporaryDirectory):
    """A folder with a report in it, with a space in its name."""

    def __init__(self, **files):
        super().__init__(prefix="trilha plot ")
        for name, content in files.items():
            with open(os.path.join(self.name, name + ".json"), "w", encoding="utf-8") as file:
                file.write(content if isinstance(content, str) else json.dumps(content))

    def files(self):
        return sorted(os.listdir(self.name))


def read(document):
    with Folder(report=document) as name:
        return plot.read_report(os.path.join(name, "report.json"))


def sheets_of(document):
    document = read(document)
    styles = plot.Styles()
    return {name: sheet for experiment in document["experiments"]
            for name, sheet in plot.draw_experiment(document, experiment, styles)}


def only_sheet(rows, **more):
    return next(iter(sheets_of(report(rows, [experiment(**more)])).values()))


def artists(sheet, start):
    return [artist for artist in sheet.axes.get_children() if (artist.get_gid() or "").startswith(start)]


@functools.lru_cache(maxsize=None)
def chapter_one_sheets(seed):
    return sheets_of(chapter_one(seed))


def drawn(sheet, start="point:"):
    """The centres of the markers that are on the sheet, in points."""
    return [(x, y) for artist in artists(sheet, start)
            for x, y in zip(artist.get_xdata(), artist.get_ydata())]


def texts(sheet):
    return [
        artist for artist in sheet.axes.get_children()
        if isinstance(artist, matplotlib.text.Text) and artist.get_text()
    ]


def box_of(sheet, text):
    """What a text covers on the sheet, in points."""
    box = text.get_window_extent(sheet.figure.canvas.get_renderer())
    return np.array([box.x0, box.y0, box.x1, box.y1]) * 72 / plot.DPI


def run(*arguments, **environment):
    return subprocess.run([sys.executable, "-B", SCRIPT, *arguments], capture_output=True, text=True,
                          env={**os.environ, **environment}, check=False)


class Rails(unittest.TestCase):
    # Catches: a zero or an infinity that is left out, drawn as a small or large number, or off its rail.
    def test_zeros_and_infinities_stand_on_rails(self):
        values = [0, 1e-9, 3.0, 1e6, INF]
        for axis in "xy":
            rows = [row(value if axis == "x" else 1.0, value if axis == "y" else 1.0) for value in values]
            sheet = only_sheet(rows)
            points = drawn(sheet)
            self.assertEqual(len(points), len(values))
            for rail, expected in ((f"rail:zero:{axis}", 1), (f"rail:infinity:{axis}", 1)):
                (band,) = artists(sheet, rail)
                box = band.get_bbox()
                inside = [p for p in points if box.x0 < p[0] < box.x1 and box.y0 < p[1] < box.y1]
                self.assertEqual(len(inside), expected, rail)
            along = sorted(point["xy".index(axis)] for point in points)
            self.assertEqual(along, [point["xy".index(axis)] for point in points])
            self.assertGreater(min(b - a for a, b in zip(along, along[1:])), 5.0)
            words = [text.get_text() for text in artists(sheet, "tick")]
            self.assertIn("0", words)
            self.assertIn("∞", words)

    # Catches: rails where they are not needed; a zero on a linear axis taken for something special.
    def test_no_rails_without_need(self):
        self.assertEqual(artists(only_sheet([row(1.0, 2.0), row(3.0, 4.0)]), "rail"), [])
        sheet = only_sheet([row(1.0, 0.0), row(3.0, 4.0)], y={"quantity": "error", "log": False})
        self.assertEqual(artists(sheet, "rail"), [])
        self.assertEqual(len(drawn(sheet)), 2)

    # Catches: an interval that ends at zero and makes a rail, or a bar longer or shorter than the quartiles.
    def test_bars_end_at_quartiles(self):
        one = row(10.0, 1.0)
        one["error"].update(low=0, high=2.0)
        sheet = only_sheet([one, row(100.0, 1e-3)])
        self.assertEqual(artists(sheet, "rail"), [])
        panel = sheet.panels[0]
        low, high = panel.points[0].x_bar
        self.assertAlmostEqual((high - low) / (panel.points[1].px - panel.points[0].px),
                               math.log10(1.2 / 0.9), places=9)
        self.assertAlmostEqual(panel.points[0].y_bar[0], 0.0)
        (bars,) = artists(sheet, "bars:plane")
        xs = [x - panel.x for x in bars.get_xdata() if not math.isnan(x)]
        self.assertAlmostEqual(xs[0], low)
        self.assertAlmostEqual(xs[1], high)

    # Catches: a NaN or a missing number that vanishes without a word.
    def test_rows_without_a_number_are_named(self):
        rows = [
            row(1.0, 1.0),
            row(2.0, NAN, "watertight"),
            row(2.0, None, "baldwin-weber"),
            row(2.0, 2.0, time_ms=None)
        ]
        sheet = only_sheet(rows)
        self.assertEqual(len(drawn(sheet)), 1)
        self.assertEqual(len(sheet.missing), 3)
        words = " ".join(text.get_text() for text in artists(sheet, "missing"))
        self.assertIn("3 rows without a number", words)
        for name in ("watertight", "baldwin-weber", "plane"):
            self.assertIn(name, words)
        empty = only_sheet([row(1.0, NAN)])  # nothing else there: still a figure
        self.assertEqual(len(drawn(empty)), 0)
        self.assertIn("all of bunny", " ".join(text.get_text() for text in artists(empty, "missing")))


class Front(unittest.TestCase):
    # Catches: a dominated point on the front, one of the best that is not, ties, infinities.
    def test_against_brute_force(self):
        draw = random.Random(5)
        for _ in range(400):
            ties = draw.random() < 0.5
            values = [0.0, 1.0, 2.0, 3.0, math.inf] if ties else [draw.random() for _ in range(9)]
            points = [(draw.choice(values), draw.choice(values)) for _ in range(draw.randrange(0, 14))]
            best = [i for i, (x, y) in enumerate(points) if math.isfinite(x) and math.isfinite(y) and
                    not any(a <= x and b <= y and (a, b) != (x, y) for a, b in points)]
            self.assertEqual(sorted(plot.pareto_front(points)), best, points)

    # Catches: a staircase that misses its points, runs above one of them, or stands where less is not better.
    def test_where_it_is_drawn(self):
        draw = random.Random(6)
        rows = [
            row(draw.uniform(1, 100), draw.choice([0, draw.uniform(1, 100)]), draw.choice(TESTS))
            for _ in range(30)
        ]
        sheet = only_sheet(rows)
        (line,) = artists(sheet, "pareto")[:1]
        corners = list(zip(line.get_xdata(), line.get_ydata()))
        front = plot.pareto_front([(one["time_ms"]["median"], one["error"]["value"]) for one in rows])
        panel = sheet.panels[0]
        for i in front:
            at = panel.x + panel.points[i].px, panel.y + panel.points[i].py
            self.assertTrue(any(math.dist(at, corner) < 1e-6 for corner in corners))
        for (x1, y1), (x2, y2) in zip(corners, corners[1:]):
            self.assertTrue(x1 == x2 and y2 <= y1 or y1 == y2 and x2 >= x1)
            for x, y in drawn(sheet):
                self.assertFalse(x < min(x1, x2) - 1e-6 and y < min(y1, y2) - 1e-6)
        rows = [row(1.0, 1.0, settings={"triangles": 10}), row(2.0, 0.5, settings={"triangles": 20})]
        for x in ("settings.triangles", "mrays_per_s"):
            self.assertEqual(artists(only_sheet(rows, x=x), "pareto"), [])

    # Catches: a label for every panel, or none.
    def test_it_is_named_once_a_figure(self):
        for name, sheet in chapter_one_sheets(1).items():
            named = [text for text in texts(sheet) if text.get_text() == "Pareto front"]
            self.assertEqual(len(named), 0 if name == "triangles" else 1, name)


class Labels(unittest.TestCase):
    def check(self, sheet, name):
        boxes = [(text, box_of(sheet, text)) for text in texts(sheet)]
        for text, (x1, y1, x2, y2) in boxes:
            self.assertTrue(x1 >= 0 and y1 >= 0 and x2 <= plot.WIDTH and y2 <= sheet.height,
                            f"{name}: {text.get_text()} leaves the figure")
            self.assertGreaterEqual(text.get_fontsize(), 8)
        for (a, p), (b, q) in itertools.combinations(boxes, 2):
            across, down = min(p[2], q[2]) - max(p[0], q[0]), min(p[3], q[3]) - max(p[1], q[1])
            # Boxes include room for accents and descenders: letters touch where they share 2 points.
            self.assertFalse(across > 0.5 and down > 2, f"{name}: '{a.get_text()}' on '{b.get_text()}'")
        for label in artists(sheet, "label:"):
            x1, y1, x2, y2 = box_of(sheet, label)
            for x, y in drawn(sheet):
                self.assertFalse(x1 < x < x2 and y1 + 1 < y < y2 - 1,
                                 f"{name}: {label.get_text()} hides a point")

    # Catches: labels on top of each other, of points or of ticks; text that is cut off or too small to read.
    def test_nothing_overlaps_in_reports_like_the_first_chapters(self):
        for seed in range(2):
            for name, sheet in chapter_one_sheets(seed).items():
                self.check(sheet, f"{name} {seed}")

    # Catches: lines that are nowhere named.
    def test_every_line_is_named(self):
        for seed in range(2):
            for name, sheet in chapter_one_sheets(seed).items():
                keys = {text.get_text() for text in texts(sheet) if text.get_gid().startswith("key:")}
                for panel in sheet.panels:
                    labels = {label[1] for label in panel.labels}
                    for line in {point.line for point in panel.points}:
                        self.assertTrue(line in keys or line in labels, f"{name}, {panel.name}: {line}")

    # Catches: the same for few or many panels, lines and points, where coincident lines crowd.
    def test_nothing_overlaps_in_odd_reports(self):
        draw = random.Random(8)
        for panels, lines, points in ((1, 1, 1), (1, 9, 4), (3, 2, 9), (4, 7, 3), (5, 3, 5), (16, 2, 2)):
            rows = [
                row(10 ** draw.uniform(-2, 4), draw.choice([10 ** draw.uniform(-8, 2), 0, 1.0]),
                    f"technique {j}", f"scene {i}") for i in range(panels) for j in range(lines)
                for _ in range(points)
            ]
            for join in (False, True):
                for name, sheet in sheets_of(report(rows, [experiment(join=join)])).items():
                    self.check(sheet, f"{name} {panels} {lines} {points} {join}")

    # Catches: ticks that collide, or an axis without any, whatever the span.
    def test_ticks_of_any_span(self):
        for low, high in ((1, 1), (1, 1.02), (1, 1.5), (3, 40), (1e-3, 1e3), (1e-9, 1e6), (1e-300, 1e300),
                          (5e-324, 1e-300), (1e5, 3e5), (9.7e-8, 9.8e-8)):
            for log in (True, False):
                axis = {"quantity": "error", "log": log}
                for panels in (1, 3):
                    rows = [
                        row(float(value), float(value), scene=f"scene {i}") for value in (low, high)
                        for i in range(panels)
                    ]
                    sheet = only_sheet(rows, y=axis, x={"quantity": "time_ms", "log": log})
                    self.check(sheet, f"{low} {high} {log} {panels}")
                    self.assertGreaterEqual(len(artists(sheet, "tick")), 3, (low, high, log))

    # Catches: a colour that means another technique in the next figure.
    def test_a_line_has_one_colour_in_the_whole_report(self):
        rows = [row(1.0, 1.0, name) for name in TESTS]
        rows += [row(1.0, 1.0, name, experiment="f") for name in reversed(TESTS[2:])]
        first, second = sheets_of(report(rows, [experiment(), experiment("f")])).values()
        for name in TESTS[2:]:
            (one,), (two,) = artists(first, f"point:{name}"), artists(second, f"point:{name}")
            self.assertEqual(one.get_markerfacecolor(), two.get_markerfacecolor())
            self.assertEqual(one.get_marker(), two.get_marker())
        self.assertEqual(len({artist.get_markerfacecolor() for artist in artists(first, "point:")}),
                         len(TESTS))
        self.assertEqual(len({artist.get_marker() for artist in artists(first, "point:")}), len(TESTS))


class Extras(unittest.TestCase):
    # Catches: a floor or a published figure that is not drawn, or half a figure made into a whole one.
    def test_floors_and_published_figures(self):
        sheets = chapter_one_sheets(1)
        self.assertEqual(len([a for a in artists(sheets["samples_CPU"], "floor") if hasattr(a, "get_xdata")]),
                         2)
        self.assertEqual(artists(sheets["tests_CPU"], "floor"), [])
        self.assertEqual(
            sum(text.get_text() == "floor of the reference" for text in texts(sheets["samples_CPU"])), 2)
        bunny, teaset = sheets["samples_CPU"].panels
        (whole,), (half,) = bunny.published, teaset.published
        self.assertIsNotNone(whole[1])
        self.assertIsNone(half[1])
        strokes = [
            artist for artist in artists(sheets["samples_CPU"], "published:") if hasattr(artist, "get_xdata")
        ]
        self.assertEqual([list(artist.get_xdata()) for artist in strokes], [[teaset.x + half[0]] * 2])
        words = " ".join(text.get_text() for text in texts(sheets["samples_CPU"]))
        self.assertIn("Somebody 2010 on a GTX 280", words)

    # Catches: derived quantities with a wrong unit; quartiles that do not move with their median.
    def test_quantities(self):
        one = read(report([row(10.0, 3.0, settings={"n": 7})]))["rows"][0]
        for quantity, expected in (("time_ms", (10, 9, 12)), ("total_ms", (12, 11, 14)),
                                   ("ns_per_test", (10, 9, 12)), ("ms_per_ray", (1e-5, 9e-6, 1.2e-5)),
                                   ("error", (3, None, None)), ("error.rmse", (3, None, None)),
                                   ("settings.n", (7, None, None)), ("bytes", (1000, None, None))):
            for got, want in zip(plot.measure(one, quantity), expected):
                self.assertTrue(got == want or abs(got - want) < 1e-12 * abs(want), quantity)
        self.assertIsNone(plot.measure(one, "error.other"))
        one["primitive_tests"] = 0.0
        self.assertIsNone(plot.measure(one, "ns_per_test"))

    # Catches: numbers that lose digits or gain some.
    def test_numbers_as_text(self):
        for value, text in ((0, "0"), (1, "1"), (17, "17"), (1234.5, "1230"), (0.012345, "0.0123"),
                            (9.999, "10.0"), (1e-9, "1.00·10⁻⁹"), (3343968, "3.34·10⁶"), (99999, "1.00·10⁵"),
                            (math.inf, "∞"), (math.nan, "NaN"), (None, "–"), (-2.5, "−2.50")):
            self.assertIn(plot.rounded(value), (text, text.replace("1.00·10⁵", "100000")), value)
        self.assertEqual([plot.plain(value) for value in (1000, 0.25, 1e-18, 1e22)],
                         ["1000", "0.25", "1e-18", "1e22"])

    # Catches: a report of a later chapter that says nothing of its experiments, and is not drawn.
    def test_a_report_without_experiments_is_drawn(self):
        document = report([
            row(1.0, 1.0, name, scene, backend) for name in TESTS for scene in "ab"
            for backend in ("cpu", "cuda")
        ])
        del document["experiments"]
        self.assertEqual(set(sheets_of(document)), {"e_CPU", "e_CUDA"})

    # Catches: plots that share an experiment's rows and do not find them; what was left out, not said.
    def test_several_plots_of_the_same_rows(self):
        document = report([row(1.0, 1.0), row(2.0, 0.5)],
                          [experiment("one", rows_of="e"),
                           experiment("two", x="total_ms", rows_of="e")])
        document["left_out"] = ["e: the time was up"]
        sheets = sheets_of(document)
        self.assertEqual(set(sheets), {"one_CPU", "two_CPU"})
        self.assertIn("the time was up", " ".join(text.get_text() for text in texts(sheets["one_CPU"])))


class Program(unittest.TestCase):
    # Catches: figures that change from run to run, or with a hash's seed, or with the user's own settings.
    def test_the_same_report_gives_the_same_bytes(self):
        table = stability(6)
        table["rows"][0].update(failures=1, picture="p.png")
        with Folder(report=chapter_one(1), stability=table) as name, Folder() as first, Folder() as second:
            matplotlib.image.imsave(os.path.join(name, "p.png"), np.zeros((48, 64, 3)))
            settings = os.path.join(second, "matplotlibrc")
            with open(settings, "w", encoding="utf-8") as file:
                file.write("font.size: 20\npath.sketch: 1, 100, 2\nsavefig.dpi: 50\n")
            one = run(name, "--out", first, PYTHONHASHSEED="1")
            two = run(name, "--out", second, PYTHONHASHSEED="2", MATPLOTLIBRC=settings)
            self.assertEqual((one.returncode, two.returncode, one.stderr), (0, 0, ""))
            files = sorted(os.listdir(first))
            self.assertEqual(files, sorted(set(os.listdir(second)) - {"matplotlibrc"}))
            self.assertEqual([os.path.join(first, file) for file in files],
                             sorted(one.stdout.split("\n")[:-1]))
            names = ("tests_cpu", "triangles", "samples_cpu", "stability_cpu", "failures_cpu")
            figures = {f"{name}.{kind}" for name in names for kind in ("svg", "png")}
            self.assertEqual(set(files), figures | {"tables.md"})
            for file in files:
                with open(os.path.join(first, file), "rb") as a, open(os.path.join(second, file), "rb") as b:
                    self.assertEqual(a.read(), b.read(), file)

    # Catches: a refusal in several lines, with the wrong code, without the file's name, or that leaves files.
    def test_broken_inputs_are_refused_in_one_line(self):
        good = report([row()])

        def change(**more):
            return {**good, **more}

        def of_row(**more):
            return change(rows=[row(**more)])

        def without(name):
            return change(rows=[{key: value for key, value in row().items() if key != name}])

        cases = {
            "empty": ("", "report.json"),
            "broken": ('{"chapter": "x",', "line 1"),
            "list": ("[]", "object"),
            "deep": ("[" * 100000, "deep"),
            "not UTF-8": (None, "utf-8"),
            "no rows": ({"chapter": "x"}, '"rows"'),
            "no chapter": ({"rows": []}, '"chapter"'),
            "rows": (change(rows=5), '"rows"'),
            "row": (change(rows=[5]), "rows[0]"),
            "no error": (without("error"), '"error"'),
            "no technique": (without("technique"), '"technique"'),
            "no experiment": (without("experiment"), '"experiment"'),
            "number": (of_row(bytes="many"), "bytes"),
            "negative": (of_row(y=-1.0), "negative"),
            "minus infinity": (of_row(y="-Infinity"), "negative"),
            "quantity": (change(experiments=[experiment(x="speed")]), "speed"),
            "axis": (change(experiments=[{"name": "e"}]), '"x"'),
            "field": (change(experiments=[experiment(line=["tecnique"])]), "tecnique"),
            "twice": (change(experiments=[experiment(), experiment()]), "two"),
            "setting": (change(rows=[row(settings={"n": "many"})],
                               experiments=[experiment(x="settings.n")]), "many"),
            "nested setting": (of_row(settings={"n": [1]}), "settings.n"),
            "published": (of_row(published={"time_ms": 1}), '"by"'),
            "newlines": (change(rows=[row(technique="a\nb", bytes="x\ny")]), "bytes"),
        }
        for name, (content, words) in cases.items():
            with self.subTest(name), Folder(report=content if content is not None else "") as folder:
                if content is None:
                    with open(os.path.join(folder, "report.json"), "wb") as file:
                        file.write(b'{"chapter": "\xff"}')
                code, out, err = self.call(folder)
                self.assertEqual((code, out, err.count("\n")), (1, "", 1), err)
                self.assertTrue(err.startswith(f"error: {folder}/report.json"), err)
                self.assertIn(words, err)
                self.assertEqual(os.listdir(folder), ["report.json"])
        bad = stability(2)
        bad["rows"][3]["failures"] = 5000
        with Folder(report=good, stability=bad) as folder:
            code, out, err = self.call(folder)
            self.assertEqual((code, out, err.count("\n")), (1, "", 1))
            self.assertIn("stability.json: rows[3]", err)
            self.assertEqual(sorted(os.listdir(folder)), ["report.json", "stability.json"])
        with Folder() as folder:
            code, out, err = self.call(os.path.join(folder, "nowhere"))
            self.assertEqual((code, out, err.count("\n")), (1, "", 1))
            self.assertEqual(os.listdir(folder), [])
        with Folder(report=good) as folder:  # a file where the folder should be
            code, out, err = self.call(folder, "--out", os.path.join(folder, "report.json"))
            self.assertEqual((code, out, err.count("\n")), (1, "", 1))
        for arguments in ((), ("a", "b"), ("a", "--no-such-flag"), ("a", "--out")):
            result = run(*arguments)
            self.assertEqual((result.returncode, result.stdout, result.stderr.count("\n")), (2, "", 1),
                             result.stderr)

    @staticmethod
    def call(*arguments):
        out, err = io.StringIO(), io.StringIO()
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            code = plot.main(list(arguments))
        return code, out.getvalue(), err.getvalue()

    # Catches: a disk that fills up and leaves some figures new and some old, or a scratch folder behind.
    def test_a_failing_write_leaves_nothing(self):
        with Folder(report=report([row()])) as folder:
            real = open

            def full(path, mode="r", **more):
                if "w" in mode and path.endswith(".png"):
                    raise OSError(28, "No space left on device", path)
                return real(path, mode, **more)

            plot.open = full
            try:
                code, out, err = self.call(folder)
            finally:
                del plot.open
            self.assertEqual((code, out, err.count("\n")), (1, "", 1))
            self.assertIn("No space left", err)
            self.assertEqual(os.listdir(folder), ["report.json"])

    # Catches: names that are read as mathematics, markup or a path, and text that breaks XML or a table.
    def test_hostile_names(self):
        names = [
            "$x_1$ $\\frac{$", "a|b & <c> \"d\" 100 %", "../../etc/passwd", "größer → 光 \u202e", "x" * 200,
            "nul\x00 \x1b[31m", "\ud800", "", "`code` *b* [l](u)", "many words " * 20
        ]
        rows = [
            row(float(i + 1), 1.0 / (i + 1), a, b, settings={a or "s": b}, experiment="e",
                published={"time_ms": 2.0, "by": a, "hardware": b})
            for i, (a, b) in enumerate(itertools.product(names, names))
        ]
        document = report(rows, [
            experiment(title=names[1], note=names[0], figure=["technique"], line=["scene"],
                       panel=["settings." + names[0]])
        ])
        document["device"]["cpu"] = "cpu " * 100
        with Folder(report=document) as folder, Folder() as out:
            code, _, err = self.call(folder, "--out", os.path.join(out, "new"))
            self.assertEqual(code, 0, err)
            self.assertEqual(os.listdir(out), ["new"])
            for file in os.listdir(os.path.join(out, "new")):
                self.assertRegex(file, r"^[a-z0-9_-]{1,90}\.(svg|png|md)$")
                if file.endswith(".svg"):
                    root = ElementTree.parse(os.path.join(out, "new", file)).getroot()
                    ids = [element.get("id") for element in root.iter() if element.get("id")]
                    self.assertEqual(len(ids), len(set(ids)))
                    self.assertTrue(root.find("{http://www.w3.org/2000/svg}title").text)
            with open(os.path.join(out, "new", "tables.md"), encoding="utf-8") as file:
                lines = [line for line in file if line.startswith("|")]
            self.assertEqual(len(lines), len(rows) + 2)
            bars = {line.replace("\\\\", "").replace("\\|", "").count("|") for line in lines}
            self.assertEqual(len(bars), 1)
        for sheet in sheets_of(document).values():
            for text in texts(sheet):
                x1, _, x2, _ = box_of(sheet, text)
                self.assertTrue(x1 >= 0 and x2 <= plot.WIDTH, text.get_text())
                self.assertTrue(not text.get_parse_math() or text.get_gid().startswith("tick"),
                                text.get_text())

    # Catches: points that are lost among many, and time that grows with their square.
    def test_thousands_of_rows(self):
        draw = random.Random(9)
        rows = [
            row(10 ** draw.uniform(0, 3), draw.choice([0, INF, 10 ** draw.uniform(-5, 5)]),
                draw.choice(TESTS), f"scene {i % 4}") for i in range(6000)
        ]
        start = time.monotonic()
        sheet = only_sheet(rows)
        self.assertLess(len(sheet.svg()), 5e6)
        self.assertLess(time.monotonic() - start, 30)  # it takes two; machines may be busy
        self.assertEqual(len(drawn(sheet)), len(rows))


class Stability(unittest.TestCase):
    def read(self, document):
        with Folder(stability=document) as name:
            return plot.read_stability(os.path.join(name, "stability.json"))

    # Catches: a failure that is not by nature and looks like one that is, or calm; a cell without its rate.
    def test_alarms_are_where_they_should_be(self):
        document = stability()
        sheets = plot.draw_stability(self.read(document), "cpu")
        count = lambda start: sum(len(artists(sheet, start)) for _, sheet in sheets)
        self.assertEqual(count("alarm:"),
                         sum(1 for one in document["rows"] if one["failures"] and not one["by_nature"]))
        self.assertEqual(count("nature:"),
                         sum(1 for one in document["rows"] if one["failures"] and one["by_nature"]))
        words = [text.get_text() for _, sheet in sheets for text in texts(sheet)]
        self.assertEqual(sum(1 for word in words if word == "0 of 4\u2009096"),
                         sum(1 for one in document["rows"] if not one["failures"]))
        self.assertEqual(sum(1 for word in words if word.startswith("✗")), count("alarm:"))
        for case in range(25):
            self.assertTrue(any(f"{word} ".startswith(f"case {case} ") for word in words))

    # Catches: a table that does not fit, however many cases and techniques it has.
    def test_any_size_fits(self):
        for cases, techniques in ((1, 1), (3, 2), (25, 4), (30, 5), (8, 9)):
            document = stability(cases, [f"technique number {i}" for i in range(techniques)])
            document["rows"][0].update(failures=1, picture="p.png")
            with Folder(stability=document) as folder:
                matplotlib.image.imsave(os.path.join(folder, "p.png"), np.zeros((72, 96, 3)))
                table = plot.read_stability(os.path.join(folder, "stability.json"))
                sheets = plot.draw_stability(table, "cpu") + plot.draw_failures(table, "cpu")
            self.assertTrue(any(artists(sheet, "picture:") for _, sheet in sheets))
            for name, sheet in sheets:
                Labels.check(self, sheet, f"{name} {cases} {techniques}")
                self.assertLessEqual(sheet.height, 792, name)

    # Catches: rates that are rounded to none or to all.
    def test_rates(self):
        for failures, of, text in ((0, 10, "0 of 10"), (10, 10, "all"), (0, 0, "not run"),
                                   (1, 4096, "1 of 4\u2009096"), (4095, 4096, "99.9 %"), (37, 100, "37 %"),
                                   (3, 112800000, "3 of 1.13·10⁸"), (112799999, 112800000, "99.9 %")):
            self.assertEqual(plot.rate_text(plot.Cell(failures, of, None, "", False, "", None)), text)

    # Catches: pictures that are smoothed, or enlarged by half pixels; one that is missing, and ends it all.
    def test_pictures_are_enlarged_by_whole_factors(self):
        document = stability(2, TESTS)
        for i, one in enumerate(document["rows"]):
            one.update(failures=1, picture=f"pictures/{i}.png")
        with Folder(stability=document) as folder:
            os.mkdir(os.path.join(folder, "pictures"))
            sizes = [64, 96, 128, 100, 300, 64, 64]
            for i, size in enumerate(sizes):
                matplotlib.image.imsave(os.path.join(folder, f"pictures/{i}.png"),
                                        np.random.default_rng(i).random((size, size, 3)))
            err = io.StringIO()
            with contextlib.redirect_stderr(err):
                table = plot.read_stability(os.path.join(folder, "stability.json"))
                ((_, sheet),) = plot.draw_failures(table, "cpu")
            self.assertEqual(err.getvalue().count("\n"), 1)
            self.assertIn("1 picture is missing", err.getvalue())
            self.assertIn("pictures/7.png: No such file", err.getvalue())
            pictures = artists(sheet, "picture:")
            self.assertEqual(len(pictures), len(sizes))
            for picture, size in zip(pictures, sizes):
                x1, x2, y1, y2 = (edge / plot.PIXEL for edge in picture.get_extent())
                for edge in (x1, x2, y1, y2):
                    self.assertAlmostEqual(edge, round(edge), places=6)
                self.assertAlmostEqual(x2 - x1, 256 // size * size if size <= 256 else 256)


if __name__ == "__main__":
    unittest.main(warnings="ignore")  # a glyph that the font lacks is no news here
