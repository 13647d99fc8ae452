#!/usr/bin/env python3
"""PixelNeRF in plain PyTorch, to compare viewfuse with: the same network, parameters, samples and picture.

Written after the paper (Yu, Ye, Tancik, Kanazawa: "pixelNeRF", CVPR 2021) and the structure of the official code: every
point is repeated for every view, latents are looked up with grid_sample, each layer is one call, points go through the
network in batches of 100000 as in the official evaluation. Two things are viewfuse's: the views are combined by weights
(--weights mean is the published way), and samples come from viewfuse's counter-based random numbers, around the mean
depth, so that both programs ask about the same points and their pictures can be compared pixel by pixel.

Needs torch, numpy, safetensors and pillow (pip install torch numpy safetensors pillow; on Debian python3-torch,
python3-numpy, python3-safetensors, python3-pil). Examples:

    pixelnerf.py tests/data/toy --sources 0,8,16 --target 20 --size 32
    pixelnerf.py car/ --sources 0,8,16 --target 4 --rays 512       # the rate a ray is that of the whole picture
    pixelnerf.py tests/data/car --model host/models/pixelnerf_cars.safetensors --sources 16,72,136 --target 48
    pixelnerf.py --check pixelnerf_srn.safetensors                 # against numbers of the official code
"""

import argparse
import json
import math
import platform
import time
from pathlib import Path

import numpy as np
import torch
import torch.nn.functional as F
from PIL import Image
from safetensors import safe_open
from safetensors.torch import load_file

# The published network: channels and blocks of the trunk's levels, sizes of the point networks. Other members of the family
# are read off their tensors.
LEVELS = ((64, 3), (128, 4), (256, 6))
SOURCE_SIDE = 128
WIDTH, BLOCKS, INJECTED, OCTAVES, FREQUENCY = 512, 5, 3, 6, 1.5


# Where tensors are: --device.
DEVICE = torch.device("cpu")


# Of products and convolutions on a GPU.
PRECISIONS = ["f32", "tf32", "f16"]


def use(options):
    """Takes all work to options.device, in options.precision, on options.threads."""
    global DEVICE
    DEVICE = torch.device(options.device)
    # The CPU is the default; older PyTorch cannot set it.
    if DEVICE.type != "cpu":
        torch.set_default_device(DEVICE)
    rounded = options.precision == "tf32"
    torch.backends.cuda.matmul.allow_tf32 = torch.backends.cudnn.allow_tf32 = rounded
    if options.threads:
        torch.set_num_threads(options.threads)


def rounding(options):
    """What products run in: as they are, or with factors rounded to f16 where PyTorch does that."""
    return torch.autocast(DEVICE.type, torch.float16, enabled=options.precision == "f16")


# Parameters


def by_formula(name, shape, gain=1.0):
    """A tensor computed from its name; the rule is in host/src/formula.rs."""
    state = 0xCBF29CE484222325
    for byte in name.encode():
        state = ((state ^ byte) * 0x100000001B3) % 2**64
    with np.errstate(over="ignore"):
        z = np.uint64(state) + np.arange(1, math.prod(shape) + 1, dtype=np.uint64) * np.uint64(0x9E3779B97F4A7C15)
        z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        z = z ^ (z >> np.uint64(31))
    u = ((z >> np.uint64(40)).astype(np.int64) - 2**23).astype(np.float32) / np.float32(2**23)
    leaf = name.rsplit(".", 1)[-1]
    if leaf == "running_var":
        u = 1 + np.float32(0.25) * u
    elif leaf in ("running_mean", "bias"):
        u = np.float32(0.125) * u
    elif len(shape) > 1:
        u = np.float32(math.sqrt(3 / math.prod(shape[1:]))) * u
    else:
        u = 1 + np.float32(0.125) * u
    return torch.from_numpy(u * np.float32(gain)).reshape(shape).to(DEVICE)


def architecture():
    """Name and shape of every tensor of the published network."""

    def convolution(name, norm, shape):
        yield f"encoder.model.{name}.weight", shape
        for leaf in ("weight", "bias", "running_mean", "running_var"):
            yield f"encoder.model.{norm}.{leaf}", shape[:1]

    def linear(name, outer, inner):
        yield f"{name}.weight", (outer, inner)
        yield f"{name}.bias", (outer,)

    yield from convolution("conv1", "bn1", (64, 3, 7, 7))
    before = 64
    for level, (channels, count) in enumerate(LEVELS, 1):
        for block in range(count):
            name = f"layer{level}.{block}"
            yield from convolution(f"{name}.conv1", f"{name}.bn1", (channels, before, 3, 3))
            yield from convolution(f"{name}.conv2", f"{name}.bn2", (channels, channels, 3, 3))
            if block == 0 and level > 1:
                yield from convolution(f"{name}.downsample.0", f"{name}.downsample.1", (channels, before, 1, 1))
            before = channels
    latent = 64 + sum(channels for channels, _ in LEVELS)
    for network in ("mlp_coarse", "mlp_fine"):
        yield from linear(f"{network}.lin_in", WIDTH, 6 + 6 * OCTAVES)
        yield from linear(f"{network}.lin_out", 4, WIDTH)
        for block in range(BLOCKS):
            yield from linear(f"{network}.blocks.{block}.fc_0", WIDTH, WIDTH)
            yield from linear(f"{network}.blocks.{block}.fc_1", WIDTH, WIDTH)
        for block in range(INJECTED):
            yield from linear(f"{network}.lin_z.{block}", WIDTH, latent)


def parameters(model):
    """Tensors by name, where in a pixel its centre is (0 as published), the largest side of source images, and whether
    the trunk has its max pool."""
    if model == "formula":
        gain = lambda name: 6 if "lin_out.weight" in name else 1
        return {name: by_formula(name, shape, gain(name)) for name, shape in architecture()}, 0.0, SOURCE_SIDE, True
    with safe_open(model, "pt") as file:
        metadata = file.metadata() or {}
    pixel_centre = float(metadata.get("viewfuse.pixel_centre", 0))
    source_side = int(metadata.get("viewfuse.source_side", SOURCE_SIDE))
    has_pool = float(metadata.get("viewfuse.first_pool", 1)) == 1
    tensors = {name: tensor.float().to(DEVICE) for name, tensor in load_file(model).items()}
    return tensors, pixel_centre, source_side, has_pool


# Network


class PixelNerf:
    def __init__(self, tensors, pixel_centre, source_side, has_pool):
        self.tensors, self.pixel_centre, self.source_side = tensors, pixel_centre, source_side
        self.has_pool = has_pool
        latent = tensors["mlp_coarse.lin_z.0.weight"].shape[1]
        self.levels, channels = [], tensors["encoder.model.conv1.weight"].shape[0]
        while channels < latent:
            level = f"encoder.model.layer{len(self.levels) + 1}"
            self.levels.append(self.count(lambda block: f"{level}.{block}.conv1.weight"))
            channels += tensors[f"{level}.0.conv1.weight"].shape[0]
        self.blocks = self.count(lambda block: f"mlp_coarse.blocks.{block}.fc_0.weight")
        self.injected = self.count(lambda block: f"mlp_coarse.lin_z.{block}.weight")
        self.octaves = (tensors["mlp_coarse.lin_in.weight"].shape[1] - 6) // 6

    def count(self, name):
        return next(number for number in range(1000) if name(number) not in self.tensors)

    def fine(self):
        """The second pass's network; small ones have one for both."""
        return "mlp_fine" if "mlp_fine.lin_in.weight" in self.tensors else "mlp_coarse"

    def encode(self, images):
        """Latents (view, channel, side / 2, side / 2) of images (view, 3, side, side) in [-1, 1]."""
        self.side = images.shape[-1]
        x = F.relu(self.convolve(images, "conv1", "bn1", stride=2, padding=3))
        levels = [x]
        x = F.max_pool2d(x, 3, 2, 1) if self.has_pool else x
        for level, count in enumerate(self.levels, 1):
            for block in range(count):
                x = self.basic_block(x, f"layer{level}.{block}", 2 if level > 1 and block == 0 else 1)
            levels.append(x)
        size = levels[0].shape[-2:]
        self.latents = torch.cat([F.interpolate(x, size, mode="bilinear", align_corners=True) for x in levels], 1)

    def convolve(self, x, name, norm, stride, padding):
        x = F.conv2d(x, self.tensors[f"encoder.model.{name}.weight"], stride=stride, padding=padding)
        leaves = ("running_mean", "running_var", "weight", "bias")
        return F.batch_norm(x, *(self.tensors[f"encoder.model.{norm}.{leaf}"] for leaf in leaves))

    def basic_block(self, x, name, stride):
        y = F.relu(self.convolve(x, f"{name}.conv1", f"{name}.bn1", stride, 1))
        y = self.convolve(y, f"{name}.conv2", f"{name}.bn2", 1, 1)
        if f"encoder.model.{name}.downsample.0.weight" in self.tensors:
            x = self.convolve(x, f"{name}.downsample.0", f"{name}.downsample.1", stride, 0)
        return F.relu(x + y)

    def set_views(self, poses, focal, centre, weights):
        """Camera-to-world matrices with x right, y up, z backward; focal length and centre in pixels of the images."""
        self.rotation = poses[:, :3, :3].transpose(1, 2)
        self.translation = -torch.bmm(self.rotation, poses[:, :3, 3:])[..., 0]
        self.focal, self.centre, self.weights = focal, centre, weights

    def radiance(self, network, points, directions):
        """Red, green, blue and density (point, 4) of world points seen along directions."""
        views = len(self.rotation)
        rotated = torch.matmul(points.expand(views, -1, -1), self.rotation.transpose(1, 2))
        turned = torch.matmul(directions.expand(views, -1, -1), self.rotation.transpose(1, 2))
        frequencies = FREQUENCY * 2.0 ** torch.arange(self.octaves).repeat_interleave(2)
        phases = torch.tensor([0.0, math.pi / 2]).repeat(self.octaves)
        waves = torch.sin(rotated[:, :, None] * frequencies[:, None] + phases[:, None]).flatten(2)
        seen = rotated + self.translation[:, None]
        pixels = seen[..., :2] / -seen[..., 2:] * torch.tensor([self.focal, -self.focal]) + self.centre
        # Node i of the grid lies over the centre of pixel 2 i: as published, half a pixel off the nodes' own centres.
        rows, columns = self.latents.shape[-2:]
        places = (pixels - self.pixel_centre) * (2.0 / self.side) * torch.tensor([columns / (columns - 1), rows / (rows - 1)]) - 1
        latents = F.grid_sample(
            self.latents, places[:, :, None], mode="bilinear", padding_mode="border", align_corners=True
        )[..., 0].transpose(1, 2)
        raw = self.point_network(network, torch.cat([rotated, waves, turned], -1), latents)
        return torch.cat([torch.sigmoid(raw[:, :3]), F.relu(raw[:, 3:])], -1)

    def point_network(self, network, x, latents):
        x = self.linear(f"{network}.lin_in", x)
        for block in range(self.blocks):
            if block == self.injected:
                x = (x * self.weights[:, None, None]).sum(0)
            if block < self.injected:
                x = x + self.linear(f"{network}.lin_z.{block}", latents)
            inside = self.linear(f"{network}.blocks.{block}.fc_0", F.relu(x))
            x = x + self.linear(f"{network}.blocks.{block}.fc_1", F.relu(inside))
        return self.linear(f"{network}.lin_out", F.relu(x))

    def linear(self, name, x):
        return F.linear(x, self.tensors[f"{name}.weight"], self.tensors[f"{name}.bias"])

    def look(self, network, rays, depths, batch):
        """Weights (ray, sample), colours over white (ray, 3) and depths (ray, not divided by the weights' sum)."""
        points = rays[:, None, :3] + depths[..., None] * rays[:, None, 3:6]
        directions = rays[:, None, 3:6].expand_as(points)
        pairs = zip(points.reshape(-1, 3).split(batch), directions.reshape(-1, 3).split(batch))
        radiance = torch.cat([self.radiance(network, *pair) for pair in pairs]).reshape(*depths.shape, 4)
        lengths = torch.cat([depths[:, 1:], rays[:, 7:]], 1) - depths
        alphas = 1 - torch.exp(-lengths * radiance[..., 3])
        passed = torch.cumprod(torch.cat([torch.ones_like(alphas[:, :1]), 1 - alphas + 1e-10], 1), 1)
        weights = alphas * passed[:, :-1]
        colours = (weights[..., None] * radiance[..., :3]).sum(1) + 1 - weights.sum(1, keepdim=True)
        return weights, colours, (weights * depths).sum(1)


# Samples, as in core/src/random.rs and core/src/depths.rs


def uniform_pairs(seed, pixels, samples):
    """Two numbers in [0, 1) each (pixel, sample): Threefry-2x32 with 20 rounds, counted by pixel and sample."""
    key = [np.uint32(seed & 0xFFFFFFFF), np.uint32(seed >> 32)]
    key.append(np.uint32(0x1BD11BDA) ^ key[0] ^ key[1])
    with np.errstate(over="ignore"):
        x = np.broadcast_to(pixels[:, None].astype(np.uint32) + key[0], (len(pixels), len(samples)))
        y = np.broadcast_to(samples[None].astype(np.uint32) + key[1], x.shape)
        for group in range(5):
            for rotation in ((13, 15, 26, 6), (17, 29, 16, 24))[group % 2]:
                x = x + y
                y = (y << np.uint32(rotation) | y >> np.uint32(32 - rotation)) ^ x
            x = x + key[(group + 1) % 3]
            y = y + key[(group + 2) % 3] + np.uint32(group + 1)
    numbers = [(word >> np.uint32(8)).astype(np.float32) * np.float32(2**-24) for word in (x, y)]
    return [torch.from_numpy(number).to(DEVICE) for number in numbers]


def in_parts(rays, parts, inside, count):
    near, far = rays[:, 6:7], rays[:, 7:]
    return near + (far - near) * ((parts + inside) / count)


def coarse_depths(rays, pixels, count, seed):
    inside, _ = uniform_pairs(seed, pixels, np.arange(count))
    return in_parts(rays, torch.arange(count), inside, count)


def fine_depths(rays, coarse, weights, depth, pixels, counts, seed):
    """All depths in order: the coarse ones, some where the weights are, some around the depth."""
    coarse_count, importance_count, depth_count = counts
    u, v = uniform_pairs(seed, pixels, np.arange(coarse_count, sum(counts)))
    u, inside = (torch.arange(importance_count) + u[:, :importance_count]) / importance_count, v[:, :importance_count]
    masses = torch.cumsum(weights + 1e-5, 1)
    parts = torch.searchsorted(masses, u * masses[:, -1:], right=True).clamp(max=coarse_count - 1)
    u_depth = uniform_pairs(seed, pixels, np.arange(coarse_count + importance_count, sum(counts)))
    normal = torch.sqrt(-2 * torch.log(1 - u_depth[0])) * torch.cos(2 * math.pi * u_depth[1])
    opacity = weights.sum(1)
    mean = torch.where(opacity > 0, depth / opacity, rays[:, 7])
    around = (mean[:, None] + 0.01 * normal).clamp(rays[0, 6], rays[0, 7])
    return torch.sort(torch.cat([coarse, in_parts(rays, parts, inside, coarse_count), around], 1), 1)[0]


# Scenes


def read_scene(folder, numbers, most_side=None):
    """Images over white (view, 3, side, side) in [-1, 1], poses (view, 4, 4), focal length and centre of an SRN folder.
    Images of a multiple of `most_side` pixels are reduced to it by means."""
    names = sorted((path.stem for path in (folder / "pose").glob("*.txt")), key=lambda name: (len(name), name))
    lines = (folder / "intrinsics.txt").read_text().split("\n")
    focal, x, y = (float(word) for word in lines[0].split()[:3])
    poses, images = [], []
    for number in numbers:
        name = names[number]
        pose = np.array((folder / "pose" / f"{name}.txt").read_text().split(), np.float32).reshape(4, 4)
        poses.append(torch.from_numpy(pose * np.array([1, -1, -1, 1], np.float32)))  # y up, z backward
        with Image.open(folder / "rgb" / f"{name}.png") as file:
            pixels = np.asarray(file.convert("RGBA"), np.float32) / 255
        if pixels.shape[0] != pixels.shape[1]:
            raise SystemExit(f"{name}.png has {pixels.shape[1]}x{pixels.shape[0]} pixels; square ones are needed")
        over_white = pixels[..., :3] * pixels[..., 3:] + 1 - pixels[..., 3:]
        images.append(torch.from_numpy(2 * over_white - 1).permute(2, 0, 1))
    images = torch.stack(images)
    times, rest = divmod(images.shape[-1], most_side or images.shape[-1])
    if times > 1 or (times and rest):
        if rest:
            raise SystemExit(f"{folder} has {images.shape[-1]} pixels on a side, no multiple of {most_side}")
        images, focal, x, y = F.avg_pool2d(images, times), focal / times, x / times, y / times
    return images.to(DEVICE), torch.stack(poses).to(DEVICE), focal, torch.tensor([x, y])


def cast_rays(pose, focal, centre, scale, size, pixel_centre, near_far):
    """Rays (pixel, 8) through the pixels' centres, as published their upper left corners: origin, direction, near, far."""
    rows, columns = torch.meshgrid(torch.arange(size), torch.arange(size), indexing="ij")
    across = (columns + pixel_centre - centre[0] * scale) / (focal * scale)
    below = (rows + pixel_centre - centre[1] * scale) / (focal * scale)
    towards = torch.stack([across, -below, -torch.ones_like(across)], -1).reshape(-1, 3)
    directions = F.normalize(towards, dim=1) @ pose[:3, :3].T
    ends = torch.tensor(near_far).expand(len(directions), 2)
    return torch.cat([pose[:3, 3].expand_as(directions), directions, ends], 1)


# Commands


def now():
    """Seconds, after all that was asked for is done."""
    if DEVICE.type == "cuda":
        torch.cuda.synchronize()
    return time.perf_counter()


def render(options):
    network = PixelNerf(*parameters(options.model))
    numbers = [*options.sources, options.target]
    images, poses, focal, centre = read_scene(options.scene, numbers, network.source_side)
    weights = torch.full((len(options.sources),), 1 / len(options.sources))
    if options.weights != "mean":
        weights = torch.tensor([float(weight) for weight in options.weights.split(",")])
    network.set_views(poses[:-1], focal, centre, weights)
    torch.rand(64, 64) @ torch.rand(64, 64)  # starts the threads
    if DEVICE.type == "cuda":
        network.encode(images[:-1])  # a GPU's libraries choose at the first use
    start = now()
    network.encode(images[:-1])
    encode_time = now() - start
    size = options.size or network.side
    rays = cast_rays(poses[-1], focal, centre, size / network.side, size, network.pixel_centre, options.near_far)
    pixels = np.arange(len(rays))
    if options.rays and options.rays < len(rays):
        pixels = pixels[np.arange(options.rays) * len(rays) // options.rays]
    rays = rays[pixels]
    picture = np.full((size**2, 3), np.nan, np.float32)
    start = now()
    # As many rays at a time as make four batches of the second pass: depths and weights need little memory then.
    for some in np.array_split(np.arange(len(rays)), -(-len(rays) * sum(options.samples) // (4 * options.batch))):
        some_rays, some_pixels = rays[some], pixels[some]
        coarse = coarse_depths(some_rays, some_pixels, options.samples[0], options.seed)
        seen, colours, depth = network.look("mlp_coarse", some_rays, coarse, options.batch)
        if sum(options.samples[1:]) > 0:
            depths = fine_depths(some_rays, coarse, seen, depth, some_pixels, options.samples, options.seed)
            _, colours, _ = network.look(network.fine(), some_rays, depths, options.batch)
        picture[some_pixels] = colours.cpu()
    render_time = now() - start
    result = {
        "torch": torch.__version__,
        "blas": "mkl" if torch.backends.mkl.is_available() else "other",
        "instructions": torch.backends.cpu.get_cpu_capability() if hasattr(torch.backends, "cpu") else "not told",
        "threads": torch.get_num_threads(),
        "device": torch.cuda.get_device_name() if DEVICE.type == "cuda" else "cpu",
        "precision": options.precision,
        "python": platform.python_version(),
        "encode": encode_time,
        "render": render_time,
        "rays": len(rays),
        "milliseconds_a_ray": 1000 * render_time / len(rays),
    }
    print(json.dumps(result))
    if options.output:
        levels = (np.nan_to_num(picture).clip(0, 1) * 255 + 0.5).astype(np.uint8)
        Image.fromarray(levels.reshape(size, size, 3)).save(options.output)
    if options.compare:
        compare(options.compare, picture)


def compare(path, picture):
    """Compares the pixels that were computed with a picture of 8 bits."""
    with Image.open(path) as file:
        theirs = np.asarray(file.convert("RGB"), np.float32).reshape(-1, 3)
    known = ~np.isnan(picture[:, 0])
    differences = np.abs(np.floor(picture[known].clip(0, 1) * 255 + 0.5) - theirs[known])
    error = np.mean(differences**2)
    print(json.dumps({
        "largest_difference_levels": float(differences.max()),
        "psnr": 10 * math.log10(255**2 / error) if error > 0 else None,
    }))


def check(path):
    """Compares with numbers of the official code."""
    expected = load_file(path)
    network = PixelNerf(*parameters("formula"))
    network.encode(expected["images"].float() / 255 * 2 - 1)
    focal, centre, worst = float(expected["focal"]), torch.tensor([64.0, 64.0]), 0.0

    def report(name, ours, theirs):
        nonlocal worst
        error = ((ours - theirs).abs().max() / theirs.abs().max().clamp(min=1e-9)).item()
        worst = max(worst, error)
        print(f"{name:30} {error:.1e} of the largest value")

    report("latents", network.latents.flatten()[expected["latent_index"]], expected["latent_value"])
    for name in ("mean", "one_hot", "tilted"):  # the last are those of the rays
        network.set_views(expected["src_poses"], focal, centre, expected[f"weights.{name}"])
        for part in ("coarse", "fine"):
            ours = network.radiance(f"mlp_{part}", expected["points"], expected["viewdirs"])
            theirs = expected[f"points.{name}.{part}"]
            report(f"colours {name} {part}", ours[:, :3], theirs[:, :3])
            if theirs[:, 3].max() > 0:
                report(f"densities {name} {part}", ours[:, 3], theirs[:, 3])
    for part, depths in (("coarse", "z_coarse"), ("fine", "z_all")):
        seen = network.look(f"mlp_{part}", expected["rays"], expected[depths], 100000)
        for name, ours in zip(("weights", "rgb", "depth"), seen):
            report(f"rays {part} {name}", ours, expected[f"{part}_{name}"])
    if not worst < 1e-3:
        raise SystemExit("differs from the official code")


def main():
    numbers = lambda kind: lambda text: [kind(word) for word in text.split(",")]
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", nargs="?", type=Path, help="SRN folder: rgb/, pose/, intrinsics.txt")
    parser.add_argument("--check", metavar="FILE", help="compare with reference values instead of rendering")
    parser.add_argument("--model", default="formula", help="formula, or a .safetensors checkpoint")
    parser.add_argument("--sources", type=numbers(int), default=[0, 8, 16], help="numbers of the source views")
    parser.add_argument("--target", type=int, default=20, help="number of the view to render")
    parser.add_argument("--weights", default="mean", help="mean, or one number a source")
    parser.add_argument("--size", type=int, help="side of the picture [default: that of the sources]")
    parser.add_argument("--rays", type=int, help="compute only this many pixels, evenly spread")
    parser.add_argument("--near-far", type=numbers(float), default=[0.8, 1.8])
    parser.add_argument("--samples", type=numbers(int), default=[64, 16, 16])
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--batch", type=int, default=100000, help="points at a time")
    parser.add_argument("--threads", type=int, help="default: all cores")
    parser.add_argument("--output", help="write the picture here (.png)")
    parser.add_argument("--compare", metavar="PNG", help="compare with a picture of viewfuse")
    parser.add_argument("--device", default="cpu", help="cpu, or cuda")
    parser.add_argument("--precision", default="f32", choices=PRECISIONS, help="of products and convolutions on a GPU [default: f32]")
    options = parser.parse_args()
    use(options)
    with torch.inference_mode(), rounding(options):
        if options.check:
            check(options.check)
        elif options.scene:
            render(options)
        else:
            parser.error("a scene, or --check FILE")


if __name__ == "__main__":
    main()
