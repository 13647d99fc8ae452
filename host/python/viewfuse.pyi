"""Few-shot novel view synthesis: scenes, weights and pictures as numpy arrays."""

from collections.abc import Callable, Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Any, Literal, Optional, Union, final

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

__version__: str

class Error(Exception):
    """Work failed although its input was good: a device, for example. Bad input is a ValueError."""

@final
class Scene:
    """A scene: posed photographs, of which the poses and the headers of the photographs have been read and checked.

    Matrices are in the coordinates of the scene's files, with OpenCV axes: x to the right of the image, y down, z forward.
    Each access makes a new array.
    """

    def __init__(self, path: Union[str, PathLike[str]], masks: str = "auto") -> None:
        """Opens a folder, or a file that describes one, in any of the layouts. ValueError if it is none."""
    @property
    def path(self) -> Path:
        """The folder or file."""
    @property
    def layout(self) -> str:
        """The layout's name."""
    @property
    def warnings(self) -> list[str]:
        """Warnings of reading, a line each."""
    @property
    def names(self) -> list[str]:
        """The views' names: first those with photographs, then target poses without."""
    @property
    def has_photograph(self) -> NDArray[np.bool_]:
        """Whether each view has a photograph: [view]."""
    @property
    def sizes(self) -> NDArray[np.int64]:
        """Width and height of each view in pixels: [view][2]."""
    @property
    def poses(self) -> NDArray[np.float64]:
        """Camera-to-world matrices: [view][4][4]."""
    @property
    def intrinsics(self) -> NDArray[np.float64]:
        """Camera matrices in pixels: [view][3][3]. The origin is the outer corner of the top left pixel."""
    def photograph(self, view: str) -> NDArray[np.uint8]:
        """Decodes the photograph of one view, undistorted, with its mask as alpha: [height][width][4]."""
    def weights(
        self,
        schemes: Union[None, str, Sequence[str]] = None,
        *,
        targets: Optional[str] = None,
        sources: Optional[str] = None,
        views: Optional[int] = None,
        orbit: Optional[int] = None,
        between: Optional[tuple[str, str, int]] = None,
        spiral: Optional[int] = None,
        camera_path: Union[None, str, PathLike[str]] = None,
        poses: Optional[ArrayLike] = None,
    ) -> Weights:
        """Weighs the sources for targets under a scheme or several; without any, under every one that needs no file.

        The keywords are those of `render`.
        """
    def render(
        self,
        weights: Union[None, str, ArrayLike, Callable[[NDArray[np.float64], NDArray[np.float64]], ArrayLike]] = None,
        *,
        size: Optional[tuple[int, int]] = None,
        model: Union[None, str, PathLike[str]] = None,
        device: str = "auto",
        background: str = "auto",
        leave_out: float = 0.01,
        seed: int = 0,
        progress: Union[None, bool, Callable[[float, str], object]] = None,
        targets: Optional[str] = None,
        sources: Optional[str] = None,
        views: Optional[int] = None,
        orbit: Optional[int] = None,
        between: Optional[tuple[str, str, int]] = None,
        spiral: Optional[int] = None,
        camera_path: Union[None, str, PathLike[str]] = None,
        poses: Optional[ArrayLike] = None,
    ) -> list[Frame]:
        """Renders targets; all frames stay in memory. Ctrl-C ends it with KeyboardInterrupt.

        weights: the scheme; "auto" (the default without a model) chooses the best for the scene. Or weights of your own, none
            below 0, which are divided by their sum: an array, [source] or [target][source], both in the order of the scene
            (`scene.names`), then paths and poses; or a function of the sources'
            camera-to-world matrices, [source][4][4], and the target's, [4][4], which returns an array [source]. It is called
            for each target and, for the sources' own depths, for each source with others; with an array the default scheme
            chooses those. What it raises ends the render.
        size: width and height; by default the views' size, at most 512 pixels on a side.
        model: a checkpoint of a PixelNeRF or a GeNVS; by default the training-free field.
        device: auto, cpu, vulkan, vulkan:NUMBER or vulkan:NAME.
        background: auto, none, black, white, or "RED,GREEN,BLUE" (0 to 255).
        leave_out: sources of least weight are left out while their weights together stay at or below this.
        seed: of every random draw (the training-free field makes none).
        progress: a function that is called with the share that is done, from 0 to 1, and what is being done; what it raises
            ends the render. True: a bar of tqdm. None: one in a notebook, where tqdm is installed.
        targets, sources: lists of views, as the command takes them: "2,5,8", "0..9/3", "all".
        views: at most so many sources, as far apart as possible.
        orbit, between, spiral, camera_path: targets along a path of cameras, one of the four.
        poses: targets by camera-to-world matrices, [target][4][4], with the intrinsics of the first source.
        """
    def evaluate(
        self,
        weights: Union[
            None,
            str,
            Callable[[NDArray[np.float64], NDArray[np.float64]], ArrayLike],
            Sequence[Union[str, Callable[[NDArray[np.float64], NDArray[np.float64]], ArrayLike]]],
        ] = None,
        *,
        targets: Optional[str] = None,
        sources: Optional[str] = None,
        views: Optional[int] = None,
        size: Optional[tuple[int, int]] = None,
        model: Union[None, str, PathLike[str]] = None,
        device: str = "auto",
        background: str = "auto",
        leave_out: float = 0.01,
        seed: int = 0,
        progress: Union[None, bool, Callable[[float, str], object]] = None,
    ) -> list[Score]:
        """Scores schemes on photographs that are left out: each target from all other views, or, with sources, all other
        views from these. Without schemes, every one that needs no file. The baselines come first. Ctrl-C ends it.

        weights: a scheme, "auto", a function as for `render`, or several of these. The other keywords are those of `render`.
        """
    def optimise(
        self,
        output: Union[str, PathLike[str]],
        *,
        weights: Optional[str] = None,
        left_out: Optional[str] = None,
        towards: Optional[str] = None,
        quality: str = "fast",
        sources: Optional[str] = None,
        views: Optional[int] = None,
        count: Optional[int] = None,
        iterations: Optional[int] = None,
        resume: Union[None, str, PathLike[str]] = None,
        antialias: bool = False,
        size: Optional[tuple[int, int]] = None,
        device: str = "auto",
        background: str = "auto",
        seed: int = 0,
        progress: Union[None, bool, Callable[[float, str], object]] = None,
    ) -> Gaussians:
        """Optimises Gaussians for the photographs, and writes them. Ctrl-C ends it with KeyboardInterrupt, and what there is
        so far is written.

        output: a .ply, a smaller .spz or .splat, or an .html page.
        weights: the scheme of the surfaces and of `towards`.
        left_out: views that are no sources, and are scored on the way.
        towards: views whose weights the iterations end with.
        quality: "fast", or "standard" and "high" for minutes and some twenty photographs and more.
        count: most Gaussians. iterations: at each size of the sources.
        resume: a file of Gaussians to go on from, at the finest size.
        antialias: for pictures smaller than the photographs; a .ply or a .spz says so.
        """
    def __len__(self) -> int:
        """The number of views."""
    def __repr__(self) -> str: ...

@final
class Weights:
    """Weights of the sources for targets under schemes."""

    @property
    def schemes(self) -> list[str]:
        """The text forms of the schemes."""
    @property
    def targets(self) -> list[str]:
        """Names of the targets."""
    @property
    def sources(self) -> list[str]:
        """Names of the sources."""
    @property
    def values(self) -> NDArray[np.float32]:
        """[scheme][target][source]; those of a scheme for a target sum to 1."""
    @property
    def poses(self) -> NDArray[np.float64]:
        """Camera-to-world matrices of the targets, as those of the scene: [target][4][4]."""
    def __array__(self, dtype: Optional[DTypeLike] = None, copy: Optional[bool] = None) -> NDArray[Any]:
        """The values: numpy.asarray(weights)."""
    def __repr__(self) -> str: ...

@final
class Frame:
    """A rendered view, as arrays that share no memory with one another."""

    @property
    def name(self) -> str:
        """The target's name."""
    @property
    def scheme(self) -> str:
        """The weighting scheme, in its text form."""
    @property
    def colours(self) -> NDArray[np.float32]:
        """Red, green, blue in [0, 1] and opacity, not rounded: [height][width][4]."""
    @property
    def picture(self) -> NDArray[np.uint8]:
        """The picture: [height][width][3]."""
    @property
    def depths(self) -> Optional[NDArray[np.float32]]:
        """Depth along the principal axis in the units of the scene's files, 0 where there is no surface: [height][width].

        None for fields without depths (GeNVS).
        """
    @property
    def confidences(self) -> Optional[NDArray[np.float32]]:
        """How far each pixel can be relied on, in [0, 1]: [height][width]. None for fields that do not tell."""
    @property
    def sources(self) -> list[str]:
        """Names of the sources."""
    @property
    def weights(self) -> NDArray[np.float32]:
        """The weights that the sources were used with: [source]; they sum to 1. `weights` of run.json."""
    @property
    def weights_before(self) -> NDArray[np.float32]:
        """Those of the scheme, before sources were dropped (`leave_out`): [source]. `weights_before` of run.json."""
    @property
    def pose(self) -> NDArray[np.float64]:
        """Camera-to-world matrix, as those of the scene: [4][4]."""
    @property
    def intrinsics(self) -> NDArray[np.float64]:
        """The camera's matrix in pixels of this picture: [3][3]."""
    @property
    def truth(self) -> Optional[NDArray[np.uint8]]:
        """The photograph at the target: [height][width][3]. None without one."""
    @property
    def seen(self) -> Optional[NDArray[np.uint8]]:
        """Where the photograph shows the whole pixel (above 0): [height][width]. None where it does everywhere."""
    @property
    def psnr(self) -> Optional[float]:
        """Peak signal to noise ratio against the photograph where it is seen, decibels. None without one."""
    @property
    def corrected_psnr(self) -> Optional[float]:
        """The same after a gain and an offset of each channel were fitted to the photograph. None without one."""
    @property
    def ssim(self) -> Optional[float]:
        """Structural similarity with the photograph where it is seen. None without one, or if it shows no 7x7 pixels together."""
    @property
    def expected(self) -> Optional[tuple[float, float, float]]:
        """The PSNR to expect and the ends of the interval that holds four of five, decibels.

        None unless the scheme was chosen for the scene, and where `beyond` says why.
        """
    @property
    def beyond(self) -> Optional[tuple[Literal["far", "unseen"], float]]:
        """Why no PSNR can be expected of this picture although the scheme was chosen; None otherwise.

        "far" with how many times as far the camera is from the photographs as the farthest of these is from the
        others, or "unseen" with the share of the picture that no photograph shows.
        """
    @property
    def seconds(self) -> float:
        """Time for this view alone."""
    def save(self, path: Union[str, PathLike[str]]) -> None:
        """Writes the picture as a PNG, whole or not at all: the bytes that the command writes. Missing folders are made.

        OSError if it cannot, or if the path is no ordinary file (a device, a pipe, a link to nothing).
        """
    def __repr__(self) -> str: ...

@final
class Score:
    """The score of one scheme at one view."""

    @property
    def scheme(self) -> str:
        """The scheme, or the name of a baseline."""
    @property
    def is_baseline(self) -> bool:
        """Whether it is a baseline, which needs no field: copies and warps of the nearest sources."""
    @property
    def target(self) -> str:
        """The view's name."""
    @property
    def source_count(self) -> int:
        """Number of sources."""
    @property
    def psnr(self) -> float:
        """Peak signal to noise ratio, decibels."""
    @property
    def corrected_psnr(self) -> Optional[float]:
        """The same after a gain and an offset of each channel were fitted to the photograph."""
    @property
    def ssim(self) -> Optional[float]:
        """Structural similarity. None if the picture is smaller than 7x7."""
    @property
    def seconds(self) -> float:
        """Time for this view with this scheme."""
    def __repr__(self) -> str: ...

@final
class Gaussians:
    """A file of Gaussians that was optimised."""

    @property
    def path(self) -> Path:
        """The file."""
    @property
    def count(self) -> int:
        """The number of Gaussians."""
    @property
    def iterations(self) -> int:
        """The iterations that were made."""
    @property
    def scores(self) -> list[tuple[int, float]]:
        """Iteration and mean PSNR in decibels of the views that were left out, on the way. Empty without such views."""
    @property
    def fit(self) -> Optional[float]:
        """Mean PSNR of some of the sources themselves, which says nothing of new views. None where views were left out."""
    def __repr__(self) -> str: ...

def open(path: Union[str, PathLike[str]], masks: str = "auto") -> Scene:
    """Opens a scene: a folder, or a file that describes one, in any of the layouts. The same as Scene(path, masks).

    `masks` says what masks and alpha channels say: "object" (where it is), "ignore" (which pixels do not count), "none"
    (they are not used), or "auto": what their layout and the masks themselves show.
    """

def pose(
    photographs: Union[str, PathLike[str]],
    output: Union[str, PathLike[str]],
    *,
    focal: Optional[float] = None,
    solvers: Union[None, str, Sequence[str], Mapping[str, Union[str, PathLike[str]]]] = None,
    every: int = 1,
    layout: str = "colmap",
    seed: int = 0,
    progress: Union[None, bool, Callable[[float, str], object]] = None,
) -> Scene:
    """Finds the poses of a folder's photographs, and writes them as a scene to a folder that is not there yet, or empty.

    Photographs that are left out are UserWarnings; that no poses can be trusted is a ValueError. Ctrl-C ends it with
    KeyboardInterrupt; the same call goes on behind the attempts that were finished.

    focal: focal length in pixels of the first photograph; by default as the photographs state it, otherwise found.
    solvers: "openmvg" (the default: the program viewfuse-openmvg), "colmap", "pycolmap", or several, which confirm one
        another; or a dictionary of these names and the program of each: {"openmvg": "target/release/viewfuse-openmvg"}.
    every: every so many photographs are taken, in the order of their names.
    layout: colmap, colmap-binary or transforms.
    """

def psnr(prediction: NDArray[np.uint8], truth: NDArray[np.uint8]) -> float:
    """Peak signal to noise ratio of two pictures [height][width][3] in decibels; infinite if they are equal."""

def ssim(prediction: NDArray[np.uint8], truth: NDArray[np.uint8]) -> Optional[float]:
    """Structural similarity of two pictures [height][width][3] (uniform 7x7 window); None if they are smaller than that."""
