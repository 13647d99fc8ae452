#!/usr/bin/env python3
"""Steps of an optimisation of Gaussians in plain PyTorch, on the CPU or with CUDA: projection, blending by tiles, L1 and SSIM, autograd, Adam.

The formulas are those of viewfuse-core's `gaussian` and of viewfuse-field's `gaussians::loss`. The tiles of a picture are blended
together, those with lists of like length in one batch: a loop over single tiles takes longer. Prints one line of JSON; with
--render the picture of a view is written first.

With --whole, the iterations are those of `viewfuse optimise --quality standard --resume GAUSSIANS --iterations N` and the result is a
file: spherical harmonics up to degree 3, switched on in steps, and growth by the published rule ("3D Gaussian Splatting", section 5.2:
the mean derivative by the place in the picture) to a stated number, written from the papers and autograd; colours' derivatives by the
direction, which viewfuse leaves out, move Gaussians here, as in the published code.
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
# Of --whole: harmonics' rate as a share of the colour's, the share of the iterations from one degree to the next, how often the number
# grows and in which share of the iterations, and the opacity below which a Gaussian is pruned.
REST_SHARE, DEGREE_SHARE, GROWTHS, GROWING, PRUNED = 0.2, 0.15, 14, 0.6, 0.01
MOST, MOST_PER_PIXEL = 100_000, 0.75


def read_table(path):
    """The vertices of a binary .ply, by the names of their properties."""
    data = path.read_bytes()
    end = data.index(b"end_header\n") + len(b"end_header\n")
    properties = [line.split()[1:] for line in data[:end].decode().splitlines() if line.startswith("property")]
    kinds = {"float": "<f4", "double": "<f8", "uchar": "u1"}
    return numpy.frombuffer(data[end:], [(name, kinds[kind]) for kind, name in properties])


def columns(table, *names):
    return torch.tensor(numpy.stack([table[name] for name in names], 1).astype(numpy.float32))


def read_ply(path):
    """The Gaussians of a file in the layout of "3D Gaussian Splatting"."""
    table = read_table(path)
    return [
        columns(table, "x", "y", "z"),
        columns(table, "scale_0", "scale_1", "scale_2"),
        columns(table, "rot_0", "rot_1", "rot_2", "rot_3"),
        columns(table, "opacity")[:, 0],
        0.5 + SH_0 * columns(table, "f_dc_0", "f_dc_1", "f_dc_2"),
    ]


def read_views(folder, side):
    """Camera from world (4x4), intrinsics and photograph of each view of a transforms.json, reduced to a longest side."""
    about = json.loads((folder / "transforms.json").read_text())
    views = []
    for frame in about["frames"]:
        own = {**about, **frame}
        if any(own.get(name) for name in ("k1", "k2", "k3", "k4", "p1", "p2")):
            raise SystemExit(f"{frame['file_path']}: the lens distorts, which this program does not undo")
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
    """Mean, conic, opacity, colour, extent and index of the Gaussians that are drawn, nearest first."""
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
    return mean, conic, opacity, colour, extent, torch.nonzero(kept)[:, 0][order]


def lists(mean, extent, width, height):
    """The splats of each tile, nearest first: lists of indices; and in how many tiles each splat is."""
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
    return splats[order], lengths, torch.cumsum(lengths, 0) - lengths, columns, rows, number


def picture(gaussians, view, near, behind):
    """Red, green and blue over the background, [3][row][column], and which Gaussians are in the picture."""
    height, width = view[2].shape[1:]
    mean, conic, opacity, colour, extent, index = project(gaussians, view, near)
    entries, lengths, starts, columns, rows, number = lists(mean.detach(), extent, width, height)
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
    return whole.reshape(3, rows * TILE, columns * TILE)[:, :height, :width], index[number > 0]


def blurred(pictures):
    window = torch.exp(-torch.arange(-4, 5.0) ** 2 / (2 * 1.5**2))
    window = window / window.sum()
    rows = functional.conv2d(pictures[:, None], window[None, None, None], padding=(0, 4))
    return functional.conv2d(rows, window[None, None, :, None], padding=(4, 0))[:, 0]


def loss_of(own, photograph):
    """(1 - s) L1 + s (1 - SSIM); small differences count by their square."""
    difference = functional.huber_loss(own, photograph, delta=SMALL) / SMALL
    means = blurred(own), blurred(photograph)
    squares = blurred(own * own) - means[0] ** 2, blurred(photograph * photograph) - means[1] ** 2
    product = blurred(own * photograph) - means[0] * means[1]
    light = (2 * means[0] * means[1] + 1e-4) / (means[0] ** 2 + means[1] ** 2 + 1e-4)
    contrast = (2 * product + 9e-4) / (squares[0] + squares[1] + 9e-4)
    return (1 - STRUCTURE_SHARE) * difference + STRUCTURE_SHARE * (1 - (light * contrast).mean())


def median_depth(positions, views):
    """Of what is in the pictures."""
    depths = []
    for world, (fx, fy, cx, cy), photograph in views:
        x, y, z = (positions @ world[:3, :3].T + world[:3, 3]).unbind(1)
        across, down = fx * x / z + cx, fy * y / z + cy
        inside = (z > 0) & (across >= 0) & (down >= 0) & (across < photograph.shape[2]) & (down < photograph.shape[1])
        depths.append(z[inside])
    return float(torch.cat(depths).median())


def harmonics(unit):
    """The 15 spherical harmonics of degrees 1 to 3 along directions, in the order and with the signs of the published code."""
    x, y, z = unit.unbind(1)
    xx, yy, zz = x * x, y * y, z * z
    degree_1 = [-0.4886025 * y, 0.4886025 * z, -0.4886025 * x]
    degree_2 = [
        1.0925484 * x * y, -1.0925484 * y * z, 0.3153916 * (2 * zz - xx - yy), -1.0925484 * x * z, 0.5462742 * (xx - yy),
    ]
    degree_3 = [
        -0.5900436 * y * (3 * xx - yy), 2.8906114 * x * y * z, -0.4570458 * y * (4 * zz - xx - yy),
        0.3731763 * z * (2 * zz - 3 * xx - 3 * yy), -0.4570458 * x * (4 * zz - xx - yy), 1.4453057 * z * (xx - yy),
        -0.5900436 * x * (xx - 3 * yy),
    ]
    return torch.stack(degree_1 + degree_2 + degree_3, 1)


class Growing:
    """Gaussians whose number rises, with the moments of Adam and the scores by which they are split."""

    def __init__(self, gaussians):
        self.tensors = [*gaussians, torch.zeros(len(gaussians[0]), 15, 3)]
        self.moments = [(torch.zeros_like(own), torch.zeros_like(own)) for own in self.tensors]
        count = len(self.tensors[0])
        self.steps, self.moved, self.pictures = torch.zeros(count), torch.zeros(count), torch.zeros(count)

    def seen_from(self, world, degree):
        """The Gaussians with the colours that a camera sees."""
        position, *others, colour, rest = self.tensors
        if degree > 0:
            centre = -world[:3, :3].T @ world[:3, 3]
            count = (degree + 1) ** 2 - 1
            basis = harmonics(functional.normalize(position - centre, dim=1))[:, :count]
            colour = (colour + (basis[:, :, None] * rest[:, :count]).sum(1)).clamp(min=0)
        return [position, *others, colour]

    @torch.no_grad()
    def step(self, index, rates, camera, depth, footprint):
        """Adam (Kingma and Ba 2015) for those in a picture, and the bounds of the parameters."""
        self.steps[index] += 1
        corrections = [1 - decay ** self.steps[index] for decay in (0.9, 0.99)]
        for own, (first, second), rate in zip(self.tensors, self.moments, rates):
            if own.grad is None:
                continue
            by, shape = own.grad[index], (-1,) + (1,) * (own.dim() - 1)
            first[index] = 0.9 * first[index] + 0.1 * by
            second[index] = 0.99 * second[index] + 0.01 * by * by
            mean, square = (moment[index] / own.view(shape) for moment, own in zip((first, second), corrections))
            own[index] -= rate * mean / (square.sqrt() + 1e-15)
        position, log_scales, _, logit, _, _ = self.tensors
        world, (fx, _, _, _), _ = camera
        depths = (position[index] @ world[:3, :3].T + world[:3, 3])[:, 2]
        most = torch.log(8 * footprint * (depths / depth).clamp(min=1))
        scales = torch.minimum(log_scales[index], most[:, None])
        log_scales[index] = torch.maximum(scales, scales.max(1, keepdim=True).values - 2.3)
        logit.clamp_(-6, 6)
        self.moved[index] += position.grad[index].norm(dim=1) * depths / fx
        self.pictures[index] += 1

    @torch.no_grad()
    def grow(self, growth, first, most):
        target = int(first * max(most / first, 1) ** (growth / GROWTHS))
        self.keep(torch.nonzero(torch.sigmoid(self.tensors[3]) >= PRUNED)[:, 0])
        count = max(0, min(min(target, most) - len(self.steps), len(self.steps)))
        chosen = torch.argsort(self.moved / self.pictures.clamp(min=1), descending=True, stable=True)[:count]
        position, log_scales, rotation, logit, _, _ = self.tensors
        longest = log_scales[chosen].argmax(1)
        rows = torch.arange(count)
        apart = turned(rotation[chosen])[rows, :, longest] * (0.5 * log_scales[chosen, longest].exp())[:, None]
        solid = 1 - (1 - torch.sigmoid(logit[chosen])) ** 0.8
        log_scales[chosen, longest] -= 0.47
        logit[chosen] = torch.logit(solid)
        for moments in self.moments:
            for own in moments:
                own[chosen] = 0
        self.steps[chosen] = 0
        self.keep(torch.cat([torch.arange(len(self.steps)), chosen]))
        position = self.tensors[0]
        position[chosen] -= apart
        position[len(position) - count :] += apart
        self.moved.zero_(), self.pictures.zero_()

    def keep(self, index):
        self.tensors = [own.detach()[index].clone() for own in self.tensors]
        self.moments = [tuple(own[index].clone() for own in moments) for moments in self.moments]
        self.steps, self.moved, self.pictures = (own[index].clone() for own in (self.steps, self.moved, self.pictures))


def whole(gaussians, views, depth, behind, count, seed):
    """The iterations of the finest size."""
    growing = Growing(gaussians)
    random = numpy.random.default_rng(seed)
    footprint = depth / views[0][1][0]
    first, order = len(gaussians[0]), []
    most = min(MOST, math.ceil(MOST_PER_PIXEL * max(own[2][0].numel() for own in views)))
    growths = lambda done: min(GROWTHS, int(done * GROWTHS / (GROWING * count)))
    for iteration in range(count):
        share, done = iteration / count, (2 * count + iteration) / (3 * count)
        if iteration > 0 and growths(iteration) > growths(iteration - 1):
            growing.grow(growths(iteration), first, most)
        degree = min(3, int(share / DEGREE_SHARE))
        order = order or list(random.permutation(len(views)))
        view = views[order.pop()]
        for own in growing.tensors:
            own.requires_grad_()
            own.grad = None
        shown, index = picture(growing.seen_from(view[0], degree), view, 0.5 * depth, behind)
        penalty = OPACITY_PENALTY * torch.sigmoid(growing.tensors[3][index]).sum() / view[2][0].numel()
        (loss_of(shown, view[2]) + penalty).backward()
        colour = RATES[4] * 0.1**done
        rates = [RATES[0] * footprint * 0.3**share, RATES[1] * 0.2**done, RATES[2], RATES[3] * 0.2**done, colour, REST_SHARE * colour]
        growing.step(index, rates, view, depth, footprint)
    return growing


def write_ply(path, tensors):
    position, log_scales, rotation, logit, colour, rest = (own.detach() for own in tensors)
    names = ["x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", *(f"f_rest_{own}" for own in range(45)), "opacity"]
    names += ["scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"]
    rest = rest.transpose(1, 2).reshape(len(rest), 45)
    table = torch.cat([position, (colour - 0.5) / SH_0, rest, logit[:, None], log_scales, rotation], 1)
    head = ["ply", "format binary_little_endian 1.0", f"element vertex {len(table)}", *(f"property float {own}" for own in names)]
    path.write_bytes("\n".join([*head, "end_header\n"]).encode() + table.cpu().numpy().astype("<f4").tobytes())


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", type=Path, help="a folder with a transforms.json")
    parser.add_argument("gaussians", type=Path, help="a .ply to go on from")
    parser.add_argument("--side", type=int, default=280, help="longest side of the views")
    parser.add_argument("--iterations", type=int, default=10, help="that are timed")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--device", default="cpu", help="cpu, or cuda")
    parser.add_argument("--render", nargs=2, metavar=("VIEW", "PNG"), help="write the picture of a view")
    parser.add_argument("--whole", type=Path, metavar="PLY", help="optimise as --quality standard does, and write the Gaussians")
    parser.add_argument("--surfaces", type=Path, metavar="PLY", help="points whose median depth is the scene's [default: the Gaussians]")
    parser.add_argument("--left-out", default="", metavar="INDICES", help="views that are no sources, separated by commas")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    torch.set_num_threads(options.threads)
    # The CPU is the default; older PyTorch cannot set it.
    if options.device != "cpu":
        torch.set_default_device(options.device)
    left_out = {int(own) for own in options.left_out.split(",") if own}
    views = [own for index, own in enumerate(read_views(options.scene, options.side)) if index not in left_out]
    gaussians = read_ply(options.gaussians)
    surfaces = columns(read_table(options.surfaces), "x", "y", "z") if options.surfaces else gaussians[0]
    depth = median_depth(surfaces, views)
    behind = torch.stack([photograph.mean((1, 2)) for _, _, photograph in views]).mean(0)
    if options.render:
        with torch.no_grad():
            shown, _ = picture(gaussians, views[int(options.render[0])], 0.1 * depth, behind)
        levels = (shown.clamp(0, 1) * 255).round().byte().permute(1, 2, 0).cpu().numpy()
        Image.fromarray(levels).save(options.render[1])
    if options.whole:
        begun, computed = time.perf_counter(), time.process_time()
        grown = whole(gaussians, views, depth, behind, options.iterations, options.seed)
        seconds = {"seconds": time.perf_counter() - begun, "processor_seconds": time.process_time() - computed}
        write_ply(options.whole, grown.tensors)
        print(json.dumps({"torch": torch.__version__, "python": platform.python_version(), "gaussians": len(grown.steps), **seconds}))
        return
    gains = torch.ones(len(views), 3, 1, 1, requires_grad=True)
    learned = [own.requires_grad_() for own in gaussians] + [gains]
    rates = [RATES[0] * depth / views[0][1][0]] + RATES[1:]
    adam = torch.optim.Adam([{"params": [own], "lr": rate} for own, rate in zip(learned, rates)], betas=(0.9, 0.99))
    losses, warm = [], 2
    for iteration in range(warm + options.iterations):
        if iteration == warm:
            start, computed = time.perf_counter(), time.process_time()
        own = iteration % len(views)
        shown = picture(gaussians, views[own], 0.5 * depth, behind)[0] * gains[own]
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
