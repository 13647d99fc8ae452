"""Tests of the installed package, by `host/python/test`, which sets:

VIEWFUSE_COMMAND      the command viewfuse, to compare with
VIEWFUSE_REPOSITORY   the repository's root
"""

import ast
import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
import types
import unittest
import unittest.mock
import warnings
import zlib
from pathlib import Path

import numpy as np

import viewfuse

COMMAND = os.environ["VIEWFUSE_COMMAND"]
REPOSITORY = Path(os.environ["VIEWFUSE_REPOSITORY"])
HERE = Path(__file__).parent
ROOM = REPOSITORY / "tests/data/room"
TOY = REPOSITORY / "tests/data/toy"
CAR = REPOSITORY / "tests/data/car"
NETWORK = REPOSITORY / "host/models/pixelnerf_cars.safetensors"
SMALL = (40, 30)


def run(*arguments):
    """Runs the command."""
    return subprocess.run([COMMAND, *map(str, arguments)], capture_output=True, text=True)


def rendered(scene, *options):
    """The files that `render` writes, by name."""
    with tempfile.TemporaryDirectory() as folder:
        done = run("render", scene, *options, "--no-sheets", "-o", folder)
        assert done.returncode == 0, done.stderr
        return {path.name: path.read_bytes() for path in Path(folder).iterdir()}


def decoded(png):
    """An 8-bit RGB PNG as an array: by the format's specification, with no library of this project."""
    assert png[:8] == b"\x89PNG\r\n\x1a\n"
    place, data, header = 8, b"", None
    while place < len(png):
        length, kind = int.from_bytes(png[place : place + 4], "big"), png[place + 4 : place + 8]
        content = png[place + 8 : place + 8 + length]
        place += 12 + length
        if kind == b"IHDR":
            header = content
        elif kind == b"IDAT":
            data += content
    width, height = (int.from_bytes(header[at : at + 4], "big") for at in (0, 4))
    assert tuple(header[8:]) == (8, 2, 0, 0, 0), "8 bits, RGB, not interlaced"
    rows = np.frombuffer(zlib.decompress(data), np.uint8).reshape(height, 1 + 3 * width).astype(int)
    picture = np.zeros((height, 3 * width), int)
    above = np.zeros(3 * width, int)
    for row, (kind, *values) in enumerate(rows.tolist()):
        own = [0] * (3 * width)
        for at, value in enumerate(values):
            left, corner = (own[at - 3], int(above[at - 3])) if at >= 3 else (0, 0)
            up = int(above[at])
            if kind == 1:
                value += left
            elif kind == 2:
                value += up
            elif kind == 3:
                value += (left + up) // 2
            elif kind == 4:
                guess = left + up - corner
                distances = [abs(guess - left), abs(guess - up), abs(guess - corner)]
                value += (left, up, corner)[distances.index(min(distances))]
            own[at] = value % 256
        picture[row] = above = np.array(own)
    return picture.reshape(height, width, 3).astype(np.uint8)


def npy(data):
    with tempfile.NamedTemporaryFile(suffix=".npy") as file:
        file.write(data)
        file.flush()
        return np.load(file.name)


class Scenes(unittest.TestCase):
    def test_views(self):
        scene = viewfuse.Scene(ROOM)
        count = len(scene)
        self.assertEqual((count, scene.layout, scene.path), (11, "transforms", ROOM))
        self.assertEqual(len(scene.names), count)
        for array, shape, kind in [
            (scene.poses, (count, 4, 4), np.float64),
            (scene.intrinsics, (count, 3, 3), np.float64),
            (scene.sizes, (count, 2), np.int64),
            (scene.has_photograph, (count,), np.bool_),
        ]:
            self.assertEqual((array.shape, array.dtype), (shape, kind))
            self.assertTrue(array.flags.c_contiguous and array.flags.writeable)
        self.assertTrue((scene.sizes == [320, 240]).all() and scene.has_photograph.all())
        for rotation in scene.poses[:, :3, :3]:
            np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-5)
        np.testing.assert_array_equal(scene.poses[:, 3], np.broadcast_to([0, 0, 0, 1], (count, 4)))

    def test_poses_are_those_of_the_file(self):
        frames = json.loads((ROOM / "transforms.json").read_text())["frames"]
        scene = viewfuse.Scene(ROOM)
        # The file has OpenGL axes.
        own = {Path(frame["file_path"]).stem: np.array(frame["transform_matrix"]) * [1, -1, -1, 1] for frame in frames}
        for name, pose in zip(scene.names, scene.poses):
            np.testing.assert_allclose(pose, own[name], atol=1e-6)

    def test_photographs(self):
        scene = viewfuse.Scene(ROOM)
        photograph = scene.photograph("5")
        self.assertEqual((photograph.shape, photograph.dtype), ((240, 320, 4), np.uint8))
        self.assertTrue((photograph[..., 3] == 255).all())
        (frame,) = scene.render("mean", targets="5", sources="4,6")
        np.testing.assert_array_equal(frame.truth, photograph[..., :3])


class Weights(unittest.TestCase):
    def test_are_those_of_the_command(self):
        schemes = ["error:alpha=0.5", "mean", "gaussian"]
        weights = viewfuse.Scene(TOY).weights(schemes, targets="20..22")
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "weights.npy"
            options = [word for scheme in schemes for word in ("--weights", scheme)]
            done = run("weights", TOY, "--targets", "20..22", *options, "--npy", file)
            self.assertEqual(done.returncode, 0, done.stderr)
            np.testing.assert_array_equal(weights.values, np.load(file))
        self.assertEqual(weights.values.dtype, np.float32)
        self.assertEqual(weights.values.shape, (3, 3, len(weights.sources)))
        np.testing.assert_allclose(weights.values.sum(axis=2), 1, atol=1e-5)
        self.assertEqual((len(weights.schemes), weights.poses.shape), (3, (3, 4, 4)))
        self.assertIs(np.asarray(weights), weights.values)

    def test_targets_by_poses(self):
        scene = viewfuse.Scene(TOY)
        target = scene.names.index("000020")
        by_name = scene.weights("error:alpha=1", targets="20", sources="0..9")
        pose = scene.poses[target]
        for poses in [pose[None], pose[None].tolist(), np.asfortranarray(pose)[None]]:
            by_pose = scene.weights("error:alpha=1", poses=poses, sources="0..9")
            np.testing.assert_array_equal(by_pose.values, by_name.values)
        self.assertEqual(by_pose.targets, ["pose-000"])
        self.assertGreater(len(scene.weights(targets="20").schemes), 3)


class Pictures(unittest.TestCase):
    def test_the_example_is_the_picture_of_the_command(self):
        files = rendered(ROOM, "--targets", "5", "--weights", "error:alpha=1", "--size", "160x120")
        (picture,) = (data for name, data in files.items() if name == "005.png")
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "view.png"
            example = [sys.executable, REPOSITORY / "host/python/examples/room.py", ROOM, file]
            done = subprocess.run([*map(str, example)], capture_output=True, text=True, cwd=folder)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertEqual(file.read_bytes(), picture)
            self.assertIn("PSNR", done.stdout)
        (frame,) = viewfuse.Scene(ROOM).render("error:alpha=1", targets="5", size=(160, 120))
        np.testing.assert_array_equal(frame.picture, decoded(picture))

    def test_arrays(self):
        scene = viewfuse.Scene(ROOM)
        files = rendered(ROOM, "--targets", "2,5", "--weights", "l1", "--size", "40x30", "--depth", "npy")
        frames = scene.render("l1", targets="2,5", size=SMALL)
        self.assertEqual([frame.name for frame in frames], ["002", "005"])
        for frame in frames:
            for array, shape, kind in [
                (frame.colours, (30, 40, 4), np.float32),
                (frame.picture, (30, 40, 3), np.uint8),
                (frame.depths, (30, 40), np.float32),
                (frame.confidences, (30, 40), np.float32),
                (frame.truth, (30, 40, 3), np.uint8),
                (frame.weights, (len(frame.sources),), np.float32),
                (frame.weights_before, (len(frame.sources),), np.float32),
                (frame.pose, (4, 4), np.float64),
                (frame.intrinsics, (3, 3), np.float64),
            ]:
                self.assertEqual((array.shape, array.dtype), (shape, kind))
                self.assertTrue(array.flags.c_contiguous and array.flags.writeable)
            # The memory is what was rendered into: numpy did not copy it.
            for array in [frame.colours, frame.picture, frame.depths, frame.confidences, frame.truth]:
                self.assertFalse(array.flags.owndata)
            # One array each, not a copy at each look.
            self.assertIs(frame.colours, frame.colours)
            np.testing.assert_array_equal(frame.picture, decoded(files[f"{frame.name}.png"]))
            np.testing.assert_array_equal(frame.depths, npy(files[f"{frame.name}_depth.npy"]))
            np.testing.assert_allclose(frame.picture, frame.colours[..., :3] * 255, atol=0.51)
            self.assertAlmostEqual(frame.weights.sum(), 1, places=5)
            self.assertEqual(frame.psnr, viewfuse.psnr(frame.picture, frame.truth))
            self.assertEqual(frame.ssim, viewfuse.ssim(frame.picture, frame.truth))
            view = scene.names.index(frame.name)
            np.testing.assert_array_equal(frame.pose, scene.poses[view])
            np.testing.assert_allclose(frame.intrinsics[:2], scene.intrinsics[view][:2] / 8, rtol=1e-6)
            self.assertIsNone(frame.expected)

    def test_a_pose_is_the_view_there(self):
        scene = viewfuse.Scene(ROOM)
        (view,) = scene.render("mean", targets="5", sources="3,4,6,7", size=SMALL)
        (pose,) = scene.render("mean", poses=view.pose[None], sources="3,4,6,7", size=SMALL)
        np.testing.assert_array_equal(pose.colours, view.colours)
        self.assertEqual((pose.name, pose.truth, pose.psnr), ("pose-000", None, None))

    def test_the_scheme_is_chosen_as_by_the_command(self):
        files = rendered(ROOM, "--targets", "5", "--size", "40x30")
        (frame,) = viewfuse.Scene(ROOM).render(targets="5", size=SMALL)
        np.testing.assert_array_equal(frame.picture, decoded(files["005.png"]))
        expected, low, high = frame.expected
        self.assertTrue(low < expected < high)
        self.assertIsNone(frame.beyond)

    def test_a_picture_whose_score_cannot_be_expected_says_why(self):
        scene = viewfuse.Scene(ROOM)
        pose = scene.poses[5].copy()
        pose[:3, 3] *= 20
        (frame,) = scene.render(poses=pose[None], size=SMALL)
        why, times = frame.beyond
        self.assertEqual((frame.expected, why), (None, "far"))
        self.assertGreater(times, 1)

    def test_masks_mean_what_is_said(self):
        self.assertEqual(len(viewfuse.open(ROOM, masks="none")), len(viewfuse.open(ROOM)))
        with self.assertRaisesRegex(ValueError, "ignore"):
            viewfuse.open(ROOM, masks="perhaps")

    def test_progress(self):
        scene, told = viewfuse.open(ROOM), []
        arguments = {"targets": "5", "sources": "4,6", "size": SMALL}
        (plain,) = scene.render("mean", **arguments)
        (frame,) = scene.render("mean", progress=lambda share, stage: told.append((share, stage)), **arguments)
        np.testing.assert_array_equal(frame.picture, plain.picture)
        shares = [share for share, _ in told]
        self.assertEqual(shares, sorted(shares))
        self.assertEqual(shares[-1], 1.0)
        self.assertTrue(all(isinstance(stage, str) for _, stage in told))

        def stop(share, stage):
            raise RuntimeError("enough")

        with self.assertRaisesRegex(RuntimeError, "enough"):
            scene.render("mean", progress=stop, **arguments)
        with self.assertRaisesRegex(TypeError, "progress: True, False, None or a function"):
            scene.render("mean", progress=3, **arguments)

    def test_a_bar_where_tqdm_is_installed(self):
        closed = []

        class Bar:
            def __init__(self, total, bar_format):
                self.n, self.total = 0, total

            def set_description_str(self, text):
                self.text = text

            def close(self):
                closed.append((self.n, self.total))

        auto = types.ModuleType("tqdm.auto")
        auto.tqdm = Bar
        scene, arguments = viewfuse.open(ROOM), {"targets": "5", "sources": "4,6", "size": SMALL}
        with unittest.mock.patch.dict(sys.modules, {"tqdm": types.ModuleType("tqdm"), "tqdm.auto": auto}):
            scene.render("mean", **arguments)
            self.assertEqual(closed, [], "no notebook")
            scene.render("mean", progress=True, **arguments)
            self.assertEqual(closed, [(100, 100)])
            with unittest.mock.patch.dict(sys.modules, {"ipykernel": types.ModuleType("ipykernel")}):
                scene.render("mean", **arguments)
                self.assertEqual(len(closed), 2)
                scene.render("mean", progress=False, **arguments)
                self.assertEqual(len(closed), 2)
        with unittest.mock.patch.dict(sys.modules, {"tqdm": None, "tqdm.auto": None}):
            with self.assertRaises(ImportError):
                scene.render("mean", progress=True, **arguments)

    def test_the_notebook_runs(self):
        """Its cells one after another; with nbclient and a kernel also as Jupyter runs it."""
        path = REPOSITORY / "host/python/examples/room.ipynb"
        notebook = json.loads(path.read_text())
        cells = ["".join(cell["source"]) for cell in notebook["cells"] if cell["cell_type"] == "code"]
        self.assertGreater(len(cells), 3)
        self.assertTrue(all(not cell.get("outputs") for cell in notebook["cells"]), "it is kept without outputs")
        with tempfile.TemporaryDirectory() as folder:
            code = "\n".join(cells)
            place = {**os.environ, "VIEWFUSE_SCENE": str(ROOM)}
            done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=folder, env=place)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertIn("PSNR", done.stdout)
            self.assertTrue((Path(folder) / "view.png").is_file())
        try:
            import ipykernel  # noqa: F401
            import nbclient
            import nbformat
        except ImportError as error:
            print(f"not run by Jupyter, its cells alone: {error}", file=sys.stderr)
            return
        with tempfile.TemporaryDirectory() as folder, unittest.mock.patch.dict(os.environ, VIEWFUSE_SCENE=str(ROOM)):
            run_by_jupyter = nbclient.NotebookClient(nbformat.read(path, 4), resources={"metadata": {"path": folder}})
            run_by_jupyter.execute()
            self.assertTrue((Path(folder) / "view.png").is_file())

    def test_paths(self):
        scene = viewfuse.Scene(ROOM)
        for path, name in [({"orbit": 2}, "orbit-001"), ({"between": ("3", "7", 2)}, "between-001")]:
            frames = scene.render("mean", size=SMALL, **path)
            self.assertEqual((len(frames), frames[1].name), (2, name))

    def test_a_network(self):
        options = ["--targets", "48", "--sources", "16,72,136", "--size", "16x16"]
        files = rendered(CAR, *options, "--model", NETWORK)
        (frame,) = viewfuse.Scene(CAR).render(targets="48", sources="16,72,136", size=(16, 16), model=NETWORK)
        np.testing.assert_array_equal(frame.picture, decoded(files["000048.png"]))


class OwnWeights(unittest.TestCase):
    """Weights that are no scheme's: arrays and functions."""

    def render(self, weights, **more):
        return viewfuse.open(ROOM).render(weights, targets="2,5", sources="0,1,3,4,6,7", size=SMALL, **more)

    def test_a_function_is_a_scheme(self):
        def alike(sources, target):
            assert sources.dtype == target.dtype == np.float64 and target.shape == (4, 4)
            assert sources.shape == (len(sources), 4, 4)
            return np.ones(len(sources))

        for own, mean in zip(self.render(alike), self.render("mean")):
            np.testing.assert_array_equal(own.colours, mean.colours)
            self.assertEqual((own.scheme, mean.scheme), ("alike", "mean"))

        # Matrices are in the coordinates of the scene's files.
        poses, seen = viewfuse.open(ROOM).poses, []

        def nearest(sources, target):
            seen.append((sources, target))
            return 1 / np.linalg.norm(sources[:, :3, 3] - target[:3, 3], axis=1) ** 2

        for own, named in zip(self.render(nearest, leave_out=0), self.render("distance:power=2", leave_out=0)):
            np.testing.assert_allclose(own.weights_before, named.weights_before, atol=1e-4)
        targets = [target for _, target in seen]
        for view in [2, 5]:
            self.assertTrue(any(np.allclose(target, poses[view], atol=1e-5) for target in targets))

    def test_an_array_is_for_all_targets_or_each(self):
        row = [0, 4, 0, 1, 0, 0]
        for weights in (row, np.array(row, np.float32), np.array([row, row]), 1e-60 * np.array(row)):
            for frame in self.render(weights, leave_out=0):
                np.testing.assert_allclose(frame.weights_before, np.array(row) / 5, atol=1e-6)
                self.assertEqual(frame.scheme, "array")
        first, second = self.render(np.array([row, row[::-1]]), leave_out=0)
        np.testing.assert_allclose(second.weights_before, first.weights_before[::-1], atol=1e-6)

    def test_whole_numbers_that_are_none(self):
        room = viewfuse.open(ROOM)
        for wrong in [{"size": (-1, 10)}, {"size": (2**40, 10)}, {"seed": -1}]:
            with self.assertRaisesRegex(ValueError, "is below 0, or too large"):
                room.render(**wrong)
        with self.assertRaisesRegex(ValueError, "is below 0, or too large"):
            room.weights(orbit=10**30)
        with self.assertRaisesRegex(TypeError, "targets: a list of views is a text"):
            room.weights(targets=5)

    def test_the_order_of_an_array(self):
        room, weights = viewfuse.open(ROOM), [[1, 0], [0, 1]]
        for keywords, text in [
            ({"targets": "5,2", "sources": "4,9"}, "rows are the targets in the order of the scene, each once \\(002, 005\\)"),
            ({"targets": "2,5", "sources": "9,4"}, "columns are the sources in the order of the scene"),
        ]:
            with self.assertRaisesRegex(ValueError, text):
                room.render(weights, size=SMALL, **keywords)
        poses = np.stack([room.poses[5]] * 2)
        with self.assertRaisesRegex(ValueError, "targets 0 and 1 have one pose, and other rows"):
            room.render(weights, poses=poses, sources="4,9", size=SMALL)
        frames = room.render(weights, targets="2,5", sources="4,9", size=SMALL, leave_out=0)
        self.assertEqual([(frame.name, *frame.weights_before) for frame in frames], [("002", 1, 0), ("005", 0, 1)])
        # One row serves targets in any order.
        self.assertEqual(len(room.render([1, 2], targets="5,2", sources="4,9", size=SMALL)), 2)

    def test_what_a_function_raises_ends_the_render(self):
        calls, shares = [], []

        def fails(sources, target):
            calls.append(len(sources))
            if len(calls) == 12:
                raise KeyError("mine")
            return np.ones(len(sources))

        with self.assertRaisesRegex(KeyError, "mine"):
            viewfuse.open(ROOM).render(
                fails, orbit=40, size=SMALL, progress=lambda share, stage: shares.append(share)
            )
        self.assertEqual(len(calls), 12)
        self.assertLess(max(shares, default=0), 0.9)

    def test_the_weights_of_a_frame_are_those_of_the_record(self):
        with tempfile.TemporaryDirectory() as folder:
            options = ["--targets", "2", "--size", "40x30", "--weights", "error:alpha=1", "--leave-out", "0.05", "-o", folder]
            self.assertEqual(run("render", ROOM, *options).returncode, 0)
            (record,) = json.loads((Path(folder) / "run.json").read_text())["frames"]
        (frame,) = viewfuse.open(ROOM).render("error:alpha=1", targets="2", size=SMALL, leave_out=0.05)
        np.testing.assert_allclose(frame.weights, record["weights"], atol=1e-6)
        np.testing.assert_allclose(frame.weights_before, record["weights_before"], atol=1e-6)
        self.assertEqual(frame.weights.min(), 0)
        self.assertGreater(frame.weights_before.min(), 0)

    def test_what_cannot_be_weights(self):
        def fails(sources, target):
            raise KeyError("mine")

        with self.assertRaisesRegex(KeyError, "mine"):
            self.render(fails)
        for weights, text in [
            ([1, 2, 3], "shape \\[3\\]; it must be \\[6\\] or \\[2, 6\\]"),
            (np.zeros(6), "at least 0, one of them above 0"),
            ([[1] * 6, [1] * 5 + [float("nan")]], "target 1: weights are finite"),
            ([-1, 1, 1, 1, 1, 1], "at least 0"),
            (lambda sources, target: [1, 2], "the function returned: 2 numbers for 6 sources"),
            (b"mean", "a scheme's name, an array of numbers or a function"),
        ]:
            with self.assertRaisesRegex(ValueError, text):
                self.render(weights)


class Evaluations(unittest.TestCase):
    def test_scores_are_those_of_the_command(self):
        schemes = ["mean", "error:alpha=1", "auto"]
        scores = viewfuse.Scene(TOY).evaluate(schemes, targets="20,22", sources="0..19/4", size=(32, 32), device="cpu")
        with tempfile.TemporaryDirectory() as folder:
            options = [word for scheme in schemes for word in ("--weights", scheme)]
            where = ["--targets", "20,22", "--sources", "0..19/4", "--size", "32x32", "--device", "cpu"]
            done = run("evaluate", TOY, *where, *options, "-o", Path(folder) / "scores.csv")
            self.assertEqual(done.returncode, 0, done.stderr)
            header, *lines = [line.split(",") for line in (Path(folder) / "scores.csv").read_text().splitlines()]
        self.assertEqual(len(scores), len(lines))
        for score, line in zip(scores, lines):
            # Schemes with two parameters have a comma, but none of these.
            own = dict(zip(header, line))
            self.assertEqual((score.scheme, score.target, score.source_count), (own["scheme"], own["target"], 5))
            for value, name in [(score.psnr, "psnr_db"), (score.ssim, "ssim"), (score.corrected_psnr, "psnr-corrected")]:
                self.assertAlmostEqual(value, float(own[name]), places=5)
            self.assertEqual(score.is_baseline, score.scheme not in schemes)

    def test_a_function_is_a_row(self):
        def mine(sources, target):
            return np.ones(len(sources))

        def fails(sources, target):
            raise KeyError("mine")

        scene = viewfuse.Scene(TOY)
        small = {"targets": "20", "sources": "0..19/4", "size": (24, 24), "device": "cpu", "leave_out": 0}
        scores = {score.scheme: score.psnr for score in scene.evaluate([mine, "mean"], **small)}
        self.assertEqual(scores["mine"], scores["mean"])
        self.assertEqual([score.scheme for score in scene.evaluate(mine, **small) if not score.is_baseline], ["mine"])
        with self.assertRaisesRegex(KeyError, "mine"):
            scene.evaluate(fails, **small)
        for wrong in [[1, 2], b"mean", ["mean", 3]]:
            with self.assertRaisesRegex(ValueError, "a scheme's name or a function"):
                scene.evaluate(wrong, **small)

    def test_ctrl_c(self):
        scene = viewfuse.Scene(ROOM)
        threading.Timer(0.5, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
        with self.assertRaises(KeyboardInterrupt):
            scene.evaluate(device="cpu")


class Gaussians(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)

    def test_the_file_is_that_of_the_command(self):
        scene, small = viewfuse.Scene(TOY), {"size": (32, 32), "device": "cpu", "iterations": 30}
        for name, keywords, options in [
            ("a.ply", {"left_out": "20"}, ["--left-out", "20"]),
            ("a.html", {"seed": 3, "sources": "0..19/2"}, ["--seed", "3", "--sources", "0..19/2"]),
            ("a.splat", {"towards": "20", "count": 300}, ["--towards", "20", "--count", "300"]),
        ]:
            made = scene.optimise(self.folder / name, **small, **keywords)
            other = self.folder / f"other-{name}"
            where = ["--size", "32x32", "--device", "cpu", "--iterations", "30"]
            done = run("optimise", TOY, *where, *options, "-o", other)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertEqual(made.path.read_bytes(), other.read_bytes(), name)
            self.assertIn(f": {made.count} Gaussians after {made.iterations} of ", done.stdout)
            self.assertEqual(bool(made.scores), "left_out" in keywords)
            self.assertEqual(made.fit is None, "left_out" in keywords)
        again = scene.optimise(self.folder / "b.ply", resume=self.folder / "a.ply", **small)
        self.assertGreater(again.count, 100)

    def test_ctrl_c_keeps_what_there_is(self):
        scene, path = viewfuse.Scene(TOY), self.folder / "a.ply"

        def interrupt():
            while not path.exists():
                time.sleep(0.01)
            os.kill(os.getpid(), signal.SIGINT)

        threading.Thread(target=interrupt).start()
        with self.assertRaises(KeyboardInterrupt):
            scene.optimise(path, size=(48, 48), device="cpu", iterations=50000)
        self.assertTrue(path.read_bytes().startswith(b"ply\n"))
        self.assertEqual([file.name for file in self.folder.iterdir()], ["a.ply"])

    def test_what_it_refuses(self):
        scene, path = viewfuse.Scene(TOY), self.folder / "a.ply"
        (self.folder / "other.ply").write_text("ply")
        for output, keywords, text in [
            (self.folder / "a.png", {}, "scenes of Gaussians are written as .ply or .html"),
            (path, {"left_out": "77"}, "77"),
            (path, {"count": 0}, "count: 0 is not a whole number from 1"),
            (path, {"resume": self.folder / "none.ply"}, "none.ply"),
            (self.folder / "other.ply", {"resume": self.folder / "other.ply"}, "is the input"),
            (TOY / "pose/000000.txt", {}, "written as"),
        ]:
            with self.assertRaisesRegex(ValueError, text):
                scene.optimise(output, size=(24, 24), device="cpu", **keywords)
        self.assertFalse(path.exists())
        with self.assertRaises(OSError):
            scene.optimise(self.folder / "other.ply" / "a.ply", device="cpu")


class Poses(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)
        self.photographs = self.folder / "bare"
        self.photographs.mkdir()
        for name in sorted(path.name for path in (ROOM / "images").iterdir())[:8]:
            (self.photographs / name).write_bytes((ROOM / "images" / name).read_bytes())

    def names(self):
        return sorted(path.name for path in self.folder.iterdir())

    def program(self, script):
        """A program in the place of viewfuse-openmvg."""
        path = self.folder / "openmvg"
        path.write_text(f"#!/bin/sh\n{script}\n")
        path.chmod(0o755)
        return {"openmvg": path}

    def test_the_scene_is_that_of_the_command(self):
        program = Path(os.environ.get("VIEWFUSE_OPENMVG", Path(COMMAND).with_name("viewfuse-openmvg")))
        if not program.exists():
            self.skipTest("no viewfuse-openmvg: `cargo openmvg` builds it")
        scene = viewfuse.pose(self.photographs, self.folder / "posed", focal=294.4, solvers={"openmvg": program})
        done = run("pose", self.photographs, "--focal", "294.4", "-o", self.folder / "other")
        self.assertEqual(done.returncode, 0, done.stderr)
        for path in sorted((self.folder / "other").rglob("*")):
            if path.is_file() and path.name != "pose.json":
                own = self.folder / "posed" / path.relative_to(self.folder / "other")
                self.assertEqual(own.read_bytes(), path.read_bytes(), path.name)
        self.assertEqual((scene.path, scene.layout), (self.folder / "posed", "colmap"))
        self.assertEqual(self.names(), ["bare", "other", "posed"])

    def test_nothing_that_can_be_trusted(self):
        nothing = self.program("read -r job; echo '{\"failed\":{\"reason\":\"nothing matches\"}}'")
        with self.assertRaisesRegex(ValueError, r"bare: no poses that can be trusted \(.*nothing matches"):
            viewfuse.pose(self.photographs, self.folder / "posed", solvers=nothing)
        self.assertEqual(self.names(), ["bare", "openmvg"])

    def test_ctrl_c_ends_the_program(self):
        stays = self.program(f"echo $$ > {self.folder}/process; exec sleep 100")
        process = self.folder / "process"

        def interrupt():
            while not process.exists() or not process.read_text().endswith("\n"):
                time.sleep(0.01)
            os.kill(os.getpid(), signal.SIGINT)

        threading.Thread(target=interrupt).start()
        start = time.monotonic()
        with self.assertRaises(KeyboardInterrupt):
            viewfuse.pose(self.photographs, self.folder / "posed", solvers=stays)
        self.assertLess(time.monotonic() - start, 60)
        with self.assertRaises(ProcessLookupError):
            os.kill(int(process.read_text()), 0)
        self.assertEqual(self.names(), ["bare", "openmvg", "process"])

    def test_what_it_refuses(self):
        posed = self.folder / "posed"
        (self.folder / "full").mkdir()
        (self.folder / "full" / "notes.txt").write_text("mine")
        for photographs, output, keywords, text in [
            (self.photographs, self.folder / "full", {}, "full: exists already and is not an empty folder"),
            (self.folder / "none", posed, {}, "none"),
            (self.photographs, posed, {"focal": 0}, "focal: 0 is not a number of pixels"),
            (self.photographs, posed, {"every": 0}, "every: 0"),
            (self.photographs, posed, {"layout": "srn"}, "colmap, colmap-binary or transforms"),
            (self.photographs, posed, {"solvers": "abacus"}, "'abacus' is none of openmvg"),
            (self.photographs, posed, {"solvers": {"openmvg": "/none/there"}}, "/none/there: the program is not there"),
        ]:
            with self.assertRaisesRegex(ValueError, text):
                viewfuse.pose(photographs, output, **keywords)
        self.assertEqual(self.names(), ["bare", "full"])


class Scores(unittest.TestCase):
    def test_by_definition(self):
        noise = np.random.default_rng(0)
        truth = noise.integers(0, 256, (20, 30, 3), np.uint8)
        other = noise.integers(0, 256, (20, 30, 3), np.uint8)
        error = ((other.astype(float) - truth) ** 2).mean()
        self.assertAlmostEqual(viewfuse.psnr(other, truth), 10 * np.log10(255**2 / error), places=9)
        self.assertEqual((viewfuse.psnr(truth, truth), viewfuse.ssim(truth, truth)), (np.inf, 1.0))
        # Slices are not contiguous.
        wide = np.concatenate([other, truth], axis=1)
        self.assertEqual(viewfuse.psnr(wide[:, :30], truth), viewfuse.psnr(other, truth))
        self.assertEqual(viewfuse.ssim(wide[:, :30], truth), viewfuse.ssim(other, truth))
        self.assertIsNone(viewfuse.ssim(truth[:6], other[:6]))
        # Nor are columns first in the order of rows.
        columns_first = np.asfortranarray(other)
        self.assertEqual(viewfuse.psnr(columns_first, truth), viewfuse.psnr(other, truth))
        self.assertEqual(viewfuse.ssim(columns_first, truth), viewfuse.ssim(other, truth))

    def test_other_threads_run_and_ctrl_c_ends_it(self):
        # Seconds of work.
        picture = np.zeros((4000, 6000, 3), np.uint8)
        counts, is_done = [0], threading.Event()

        def other():
            while not is_done.wait(0.001):
                counts[0] += 1

        thread = threading.Thread(target=other)
        thread.start()
        threading.Timer(0.3, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
        with self.assertRaises(KeyboardInterrupt):
            for _ in range(1000):
                viewfuse.ssim(picture, picture)
        is_done.set()
        thread.join()
        self.assertGreater(counts[0], 10)

    def test_what_is_no_pair(self):
        picture = np.zeros((4, 5, 3), np.uint8)
        for wrong in [picture.astype(float), picture[..., 0], picture[..., :2], [[1]], None]:
            with self.assertRaisesRegex(TypeError, "a picture is an array of uint8, height x width x 3, not "):
                viewfuse.psnr(picture, wrong)
        with self.assertRaisesRegex(ValueError, "not of 5x4 and 4x4"):
            viewfuse.ssim(picture, picture[:, :4])


class Errors(unittest.TestCase):
    def refused(self, call, *arguments):
        """The text of the ValueError, which is that of the command."""
        with self.assertRaises(ValueError) as caught:
            call()
        printed = run(*arguments).stderr.strip()
        # The command names its option first.
        texts = [f"viewfuse: {caught.exception}", f"viewfuse: --model: {caught.exception}"]
        self.assertTrue(printed.startswith(tuple(texts)), f"{caught.exception}\n{printed}")

    def test_the_texts_are_those_of_the_command(self):
        scene = viewfuse.Scene(ROOM)
        self.refused(lambda: viewfuse.Scene("nowhere"), "inspect", "nowhere")
        self.refused(lambda: viewfuse.Scene(HERE), "inspect", HERE)
        weights = ["weights", ROOM, "--targets"]
        self.refused(lambda: scene.weights("mean", targets="77"), *weights, "77")
        self.refused(lambda: scene.weights("mean"), "weights", ROOM)
        self.refused(lambda: scene.weights("mean", targets="5", sources="5"), *weights, "5", "--sources", "5")
        render = ["render", ROOM, "--targets", "5", "-o", "nowhere"]
        self.refused(lambda: scene.render(targets="5", size=(10, 90)), *render, "--size", "10x90")
        self.refused(lambda: scene.render(targets="5", model="nothing.pth"), *render, "--model", "nothing.pth")
        self.refused(lambda: scene.render(targets="5", sources="4"), *render, "--sources", "4")

    def test_arguments(self):
        scene = viewfuse.Scene(ROOM)
        for keywords, text in [
            ({"schemes": "best"}, "best"),
            ({"orbit": 1, "spiral": 1}, "one choice"),
            ({"orbit": 0}, "orbit: 0"),
            ({"poses": np.eye(4)}, "N x 4 x 4"),
            ({"poses": np.zeros((0, 4, 4))}, "N x 4 x 4"),
            ({"poses": np.ones((1, 4, 4))}, r"poses\[0\]: the last row"),
            ({"poses": np.full((1, 4, 4), np.nan)}, r"poses\[0\]: .* not finite"),
        ]:
            with self.assertRaisesRegex(ValueError, text):
                scene.weights(**{"schemes": "mean", **keywords})
        for keywords in [{"target": "5"}, {"targets": 5}, {"between": ("3", "7")}]:
            with self.assertRaises((TypeError, ValueError)):
                scene.weights("mean", **keywords)
        for keywords in [{"device": "abacus"}, {"background": "plaid"}, {"leave_out": 1.0}, {"size": (0, 1)}]:
            with self.assertRaises(ValueError):
                scene.render("mean", targets="5", **keywords)
        with self.assertRaises(viewfuse.Error):
            scene.render("mean", targets="5", device="vulkan:there is no such device")
        self.assertTrue(issubclass(viewfuse.Error, Exception) and not issubclass(viewfuse.Error, ValueError))

    def test_a_file_that_cannot_be_written(self):
        (frame,) = viewfuse.Scene(ROOM).render("mean", targets="5", sources="4,6", size=SMALL)
        with self.assertRaises(OSError):
            frame.save(Path(__file__) / "view.png")
        with tempfile.TemporaryDirectory() as folder:
            pipe = Path(folder) / "pipe"
            os.mkfifo(pipe)
            with self.assertRaisesRegex(OSError, "no ordinary file"):
                frame.save(pipe)
            self.assertTrue(pipe.is_fifo())

    def test_a_forked_process_is_told(self):
        script = """
import multiprocessing, os, sys
import viewfuse
scene = viewfuse.Scene(sys.argv[1])
scene.render("mean", targets="5", sources="4,6", size=(8, 6))
def child(_):
    try:
        scene.render("mean", targets="5", sources="4,6", size=(8, 6))
    except RuntimeError as error:
        return str(error)
with multiprocessing.get_context("fork").Pool(1) as pool:
    print(pool.map(child, [0])[0])
"""
        done = subprocess.run([sys.executable, "-c", script, ROOM], capture_output=True, text=True, timeout=60)
        self.assertIn('get_context("spawn")', done.stdout, done.stderr)

    def test_warnings_are_python_s(self):
        scene = viewfuse.Scene(ROOM)
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            scene.render("mean", targets="5", sources="0,10", size=SMALL)
        self.assertEqual([warning.category for warning in caught], [UserWarning])
        self.assertIn("depths in whole photographs are found reliably up to about 15 degrees", str(caught[0].message))
        with warnings.catch_warnings(), self.assertRaises(UserWarning):
            warnings.simplefilter("error")
            scene.render("mean", targets="5", sources="0,10", size=SMALL)

    def test_work_that_fails_warns_too(self):
        scene, calls = viewfuse.Scene(ROOM), []

        def fails_later(sources, target):
            calls.append(target)
            if len(calls) > 1:
                raise ArithmeticError("later")
            return np.ones(len(sources))

        for action, expected in [("always", [UserWarning]), ("error", [])]:
            calls.clear()
            with warnings.catch_warnings(record=True) as caught, self.assertRaisesRegex(ArithmeticError, "later"):
                warnings.simplefilter(action)
                scene.render(fails_later, targets="5", sources="0,10", size=SMALL)
            self.assertEqual([warning.category for warning in caught], expected)

    def test_ctrl_c(self):
        scene = viewfuse.Scene(ROOM)
        threading.Timer(0.5, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
        start = time.monotonic()
        with self.assertRaises(KeyboardInterrupt):
            # Minutes of work.
            scene.render("error:alpha=1", orbit=2000, device="cpu")
        self.assertLess(time.monotonic() - start, 20)

    def test_other_threads_run(self):
        scene, count, is_done = viewfuse.Scene(ROOM), [0], threading.Event()

        def other():
            while not is_done.wait(0.001):
                count[0] += 1

        thread = threading.Thread(target=other)
        thread.start()
        start = time.monotonic()
        scene.render("mean", targets="5", size=(80, 60))
        is_done.set()
        thread.join()
        # A thousand a second, were the machine idle.
        self.assertGreater(count[0], 10 * (time.monotonic() - start))


class Stubs(unittest.TestCase):
    def test_they_are_what_there_is(self):
        file = Path(viewfuse.__file__).with_name("__init__.pyi")
        self.assertTrue(file.is_file() and file.with_name("py.typed").is_file())
        tree = ast.parse(file.read_text())
        stated = {}
        for node in tree.body:
            if isinstance(node, ast.ClassDef):
                stated[node.name] = {item.name for item in node.body if isinstance(item, ast.FunctionDef)}
            elif isinstance(node, ast.FunctionDef):
                stated[node.name] = set()
        there = {name for name in vars(viewfuse) if not name.startswith("_") and name != "viewfuse"}
        self.assertEqual(set(stated), there)
        for name in ["Scene", "Weights", "Frame", "Score", "Gaussians"]:
            own = vars(getattr(viewfuse, name))
            public = {item for item in own if not item.startswith("_")}
            self.assertEqual({item for item in stated[name] if not item.startswith("_")}, public, name)
            for item in stated[name]:
                self.assertTrue(hasattr(getattr(viewfuse, name), item), f"{name}.{item}")
            for item in public:
                self.assertTrue(own[item].__doc__, f"{name}.{item} has no documentation")


if __name__ == "__main__":
    unittest.main()
