#!/usr/bin/env python3
"""Steps of an optimisation of Gaussians in plain PyTorch, on the CPU: projection, blending by tiles, L1 and SSIM, autograd, Adam.

The formulas are those of viewfuse-core's `gaussian` and of viewfuse-field's `gaussians::loss`. The tiles of a picture are blended
together, those with lists of like length in one batch: a loop over single tiles takes longer. Prints one line of JSON; with
--render the picture of a view is written first.
"""

import argparse
import json
import math
import platform
import time
from pathlib import Path

import numpy
import torch
import torch.nn.functional as functional
from PIL import Image

TILE = 8
DILATION, MIN_ALPHA, MAX_ALPHA, MARGIN = 0.3, 1 / 255, 0.99, 0.3
SH_0 = 0.2820948
# Most pairs of a pixel and a splat in a batch of tiles: some 50 MB with what autograd keeps.
MAX_PAIRS = 1_000_000
# Learning rates of position (median depth's pixels), log scale, rotation, opacity, colour, gain.
RATES = [0.1, 1.0e-2, 2.0e-3, 5.0e-2, 5.0e-3, 5.0e-3]
STRUCTURE_SHARE, SMALL, OPACITY_PENALTY = 0.2, 0.01, 0.02


def read_ply(path):
    """The Gaussians of a file in the layout of "3D Gaussian Splatting"."""
    data = path.read_bytes()
    end = data.index(b"end_header\n") + len(b"end_header\n")
    lines = data[:end].decode().splitlines()
    names = [line.split()[2] for line in lines if line.startswith("property float")]
    table = numpy.frombuffer(data[end:], "<f4").reshape(-1, len(names))
    columns = lambda *wanted: torch.tensor(table[:, [names.index(name) for name in wanted]].copy())
    return [
        columns("x", "y", "z"),
        columns("scale_0", "scale_1", "scale_2"),
        columns("rot_0", "rot_1", "rot_2", "rot_3"),
        columns("opacity")[:, 0],
        0.5 + SH_0 * columns("f_dc_0", "f_dc_1", "f_dc_2"),
    ]


def read_views(folder, side):
    """Camera from world (4x4), intrinsics and photograph of each view of a transforms.json, reduced to a longest side."""
    about = json.loads((folder / "transforms.json").read_text())
    views = []
    for frame in about["frames"]:
        own = {**about, **frame}
        picture = Image.open(folder / frame["file_path"]).convert("RGB")
        scale = min(1.0, side / max(picture.size))
        size = [max(1, round(scale * length)) for length in picture.size]
        across, down = (new / old for new, old in zip(size, picture.size))
        picture = picture.resize(size, Image.BOX) if scale < 1 else picture
        photograph = torch.tensor(numpy.asarray(picture).copy()).permute(2, 0, 1).float() / 255
        pose = torch.tensor(frame["transform_matrix"], dtype=torch.float64) @ torch.diag(torch.tensor([1.0, -1, -1, 1], dtype=torch.float64))
        intrinsics = [own["fl_x"] * across, own["fl_y"] * down, own["cx"] * across, own["cy"] * down]
        views.append((torch.linalg.inv(pose).float(), intrinsics, photograph))
    return views


def turned(quaternions):
    """Rotation matrices of quaternions w, x, y, z."""
    w, x, y, z = functional.normalize(quaternions, dim=1).unbind(1)
    rows = [
        1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
        2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
        2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y),
    ]
    return torch.stack(rows, 1).reshape(-1, 3, 3)


def project(gaussians, view, near):
    """Mean, conic, opacity, colour, depth and extent of the Gaussians that are drawn, nearest first."""
    position, log_scales, rotation, logit, colour = gaussians
    world, (fx, fy, cx, cy), photograph = view
    height, width = photograph.shape[1:]
    opacity = torch.sigmoid(logit)
    place = position @ world[:3, :3].T + world[:3, 3]
    kept = (place[:, 2] >= near) & (opacity >= MIN_ALPHA)
    place, opacity, colour = place[kept], opacity[kept], colour[kept]
    order = torch.argsort(place[:, 2].detach(), stable=True)
    place, opacity, colour = place[order], opacity[order], colour[order]
    x, y, z = place.unbind(1)
    mean = torch.stack([fx * x / z + cx, fy * y / z + cy], 1)
    across = torch.clamp(x / z, (-MARGIN * width / 2 - cx) / fx, (width + MARGIN * width / 2 - cx) / fx)
    below = torch.clamp(y / z, (-MARGIN * height / 2 - cy) / fy, (height + MARGIN * height / 2 - cy) / fy)
    axes = world[:3, :3] @ turned(rotation[kept][order]) * torch.exp(log_scales[kept][order])[:, None, :]
    u = (axes[:, 0] - across[:, None] * axes[:, 2]) * (fx / z)[:, None]
    v = (axes[:, 1] - below[:, None] * axes[:, 2]) * (fy / z)[:, None]
    uu, vv, uv = (u * u).sum(1) + DILATION, (v * v).sum(1) + DILATION, (u * v).sum(1)
    inverse = 1 / (uu * vv - uv * uv)
    conic = torch.stack([vv * inverse, -uv * inverse, uu * inverse], 1)
    with torch.no_grad():
        reach = 2 * torch.log(255 * opacity).clamp(min=0)
        extent = torch.sqrt(reach[:, None] * torch.stack([uu, vv], 1))
    return mean, conic, opacity, colour, extent


def lists(mean, extent, width, height):
    """The splats of each tile, nearest first: lists of indices."""
    low = ((mean - extent) / TILE).floor().clamp(min=0).long()
    high = ((mean + extent) / TILE).floor().long()
    columns, rows = -(-width // TILE), -(-height // TILE)
    high = torch.minimum(high, torch.tensor([columns - 1, rows - 1]))
    counts = (high - low + 1).clamp(min=0)
    number = counts[:, 0] * counts[:, 1]
    splats = torch.repeat_interleave(torch.arange(len(mean)), number)
    own = torch.arange(len(splats)) - torch.repeat_interleave(torch.cumsum(number, 0) - number, number)
    column = low[splats, 0] + own % counts[splats, 0]
    row = low[splats, 1] + own // counts[splats, 0]
    tiles = row * columns + column
    order = torch.argsort(tiles, stable=True)
    lengths = torch.bincount(tiles, minlength=columns * rows)
    return splats[order], lengths, torch.cumsum(lengths, 0) - lengths, columns, rows


def picture(gaussians, view, near, behind):
    """Red, green and blue over the background, [3][row][column]."""
    height, width = view[2].shape[1:]
    mean, conic, opacity, colour, extent = project(gaussians, view, near)
    entries, lengths, starts, columns, rows = lists(mean.detach(), extent, width, height)
    inside = torch.arange(TILE * TILE)
    done, parts = [], []
    order = torch.argsort(lengths, descending=True)
    at = 0
    while at < len(order):
        longest = int(lengths[order[at]])
        count = max(1, MAX_PAIRS // max(longest * TILE * TILE, 1))
        tiles = order[at : at + count]
        at += count
        done.append(tiles)
        if longest == 0:
            parts.append(behind.expand(len(tiles), TILE * TILE, 3))
            continue
        slots = torch.arange(longest)
        there = slots[None] < lengths[tiles][:, None]
        splats = entries[(starts[tiles][:, None] + slots[None]).clamp(max=len(entries) - 1)]
        x = ((tiles % columns) * TILE)[:, None] + inside % TILE + 0.5
        y = ((tiles // columns) * TILE)[:, None] + inside // TILE + 0.5
        right, down = x[:, :, None] - mean[splats, 0][:, None], y[:, :, None] - mean[splats, 1][:, None]
        xx, xy, yy = conic[splats].unbind(2)
        power = -0.5 * (xx[:, None] * right * right + yy[:, None] * down * down) - xy[:, None] * right * down
        alpha = (opacity[splats] * there)[:, None] * torch.exp(power.clamp(max=0))
        alpha = torch.where(alpha >= MIN_ALPHA, alpha.clamp(max=MAX_ALPHA), torch.zeros(()))
        left = torch.cumprod(1 - alpha, 2)
        weights = alpha * torch.cat([torch.ones_like(left[:, :, :1]), left[:, :, :-1]], 2)
        parts.append(weights @ colour[splats] + left[:, :, -1:] * behind)
    whole = torch.cat(parts)[torch.argsort(torch.cat(done))]
    whole = whole.reshape(rows, columns, TILE, TILE, 3).permute(4, 0, 2, 1, 3)
    return whole.reshape(3, rows * TILE, columns * TILE)[:, :height, :width]


WINDOW = torch.exp(-torch.arange(-4, 5.0) ** 2 / (2 * 1.5**2))
WINDOW = WINDOW / WINDOW.sum()


def blurred(pictures):
    rows = functional.conv2d(pictures[:, None], WINDOW[None, None, None], padding=(0, 4))
    return functional.conv2d(rows, WINDOW[None, None, :, None], padding=(4, 0))[:, 0]


def loss_of(own, photograph):
    """(1 - s) L1 + s (1 - SSIM); small differences count by their square."""
    difference = functional.huber_loss(own, photograph, delta=SMALL) / SMALL
    means = blurred(own), blurred(photograph)
    squares = blurred(own * own) - means[0] ** 2, blurred(photograph * photograph) - means[1] ** 2
    product = blurred(own * photograph) - means[0] * means[1]
    light = (2 * means[0] * means[1] + 1e-4) / (means[0] ** 2 + means[1] ** 2 + 1e-4)
    contrast = (2 * product + 9e-4) / (squares[0] + squares[1] + 9e-4)
    return (1 - STRUCTURE_SHARE) * difference + STRUCTURE_SHARE * (1 - (light * contrast).mean())


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", type=Path, help="a folder with a transforms.json")
    parser.add_argument("gaussians", type=Path, help="a .ply to go on from")
    parser.add_argument("--side", type=int, default=280, help="longest side of the views")
    parser.add_argument("--iterations", type=int, default=10, help="that are timed")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--render", nargs=2, metavar=("VIEW", "PNG"), help="write the picture of a view")
    options = parser.parse_args()
    torch.set_num_threads(options.threads)
    views = read_views(options.scene, options.side)
    gaussians = read_ply(options.gaussians)
    depths = torch.cat([(gaussians[0] @ world[:3, :3].T + world[:3, 3])[:, 2] for world, _, _ in views])
    depth = float(depths[depths > 0].median())
    behind = torch.stack([photograph.mean((1, 2)) for _, _, photograph in views]).mean(0)
    if options.render:
        with torch.no_grad():
            shown = picture(gaussians, views[int(options.render[0])], 0.1 * depth, behind)
        levels = (shown.clamp(0, 1) * 255).round().byte().permute(1, 2, 0).numpy()
        Image.fromarray(levels).save(options.render[1])
    gains = torch.ones(len(views), 3, 1, 1, requires_grad=True)
    learned = [own.requires_grad_() for own in gaussians] + [gains]
    rates = [RATES[0] * depth / views[0][1][0]] + RATES[1:]
    adam = torch.optim.Adam([{"params": [own], "lr": rate} for own, rate in zip(learned, rates)], betas=(0.9, 0.99))
    losses, warm = [], 2
    for iteration in range(warm + options.iterations):
        if iteration == warm:
            start, computed = time.perf_counter(), time.process_time()
        own = iteration % len(views)
        shown = picture(gaussians, views[own], 0.5 * depth, behind) * gains[own]
        photograph = views[own][2]
        penalty = OPACITY_PENALTY * torch.sigmoid(gaussians[3]).sum() / photograph[0].numel()
        loss = loss_of(shown, photograph)
        adam.zero_grad(set_to_none=True)
        (loss + penalty).backward()
        adam.step()
        losses.append(loss.item())
    assert all(math.isfinite(own) for own in losses)
    result = {
        "torch": torch.__version__,
        "threads": torch.get_num_threads(),
        "python": platform.python_version(),
        "gaussians": len(gaussians[0]),
        "seconds": (time.perf_counter() - start) / options.iterations,
        "processor_seconds": (time.process_time() - computed) / options.iterations,
        "loss": sum(losses[warm:]) / options.iterations,
    }
    print(json.dumps(result))


if __name__ == "__main__":
    main()
