#!/usr/bin/env python3
"""GeNVS in plain PyTorch, to compare viewfuse with: the same networks, parameters, samples, noise levels and picture.

Written after the papers (Chan et al.: "GeNVS", 2023; Karras et al.: "Elucidating the design space of diffusion-based
generative models", 2022) and the structure of the code of "Pay Attention to Where You Looked": the trunk and its
decoder without batch norm, volumes looked up with grid_sample, each layer one call, the published second-order sampler
with its state in double precision. One thing is viewfuse's: a picture starts from its counter-based noise, so that both
programs start from the same and their pictures can be compared pixel by pixel.

Needs torch, numpy, safetensors and pillow (pip install torch numpy safetensors pillow; on Debian python3-torch,
python3-numpy, python3-safetensors, python3-pil). Examples:

    genvs.py tests/data/toy --sources 0,8,16 --target 20           # the published run: 25 steps, 49 calls
    genvs.py tests/data/toy --steps 0 --repeat 5                   # times of the parts alone
    genvs.py tests/data/toy --device cuda --precision f16          # with factors of products rounded
    genvs.py --check genvs_srn.safetensors                         # against numbers of the official code
    genvs.py --write genvs_small.safetensors                       # reference values of the small member of the family
"""

import argparse
import json
import math
import platform
from pathlib import Path

import numpy as np
import torch
import torch.nn.functional as F
from PIL import Image
from safetensors import safe_open
from safetensors.torch import load_file, save_file

import pixelnerf
from pixelnerf import PRECISIONS, by_formula, compare, now, read_scene, rounding, uniform_pairs, use

LISTS = {"published": "genvs_tensors.txt", "small": "genvs_small_tensors.txt"}
RATES = (12, 24, 36)  # of the dilated convolutions
SAMPLES = 64
SIGMA_DATA = 0.5
LEVELS = (80.0, 0.002)  # the largest and the smallest
ENDS = (0.8, 1.8)  # of a reference value's rays, in focal lengths
GAINS = {"pixel_nerf_net.encoder.volume_head.reshape_conv.weight": 8.0, "pixel_nerf_net.mlp.layers.2.weight": 4.0}


class Tensors(dict):
    """Parameters by formula, computed when first asked for; shapes from a list with a line a module."""

    def __init__(self, member):
        self.shapes = {}
        for line in (Path(__file__).parents[1] / "data" / LISTS[member]).read_text().splitlines():
            module, *words = line.split(" ")
            for leaf, shape in zip(words[::2], words[1::2]):
                self.shapes[f"{module}.{leaf}"] = [int(length) for length in shape.split("x")]

    def __missing__(self, name):
        self[name] = by_formula(name, self.shapes[name], GAINS.get(name, 1.0))
        return self[name]

    def has(self, name):
        return name in self.shapes


class Genvs:
    def __init__(self, member):
        self.tensors = Tensors(member)
        self.features = self.tensors.shapes["pixel_nerf_net.mlp.layers.0.weight"][1]
        self.frequency_count = self.tensors.shapes["denoiser.model.map_layer0.weight"][1] // 2

    # Encoder

    def conv(self, x, name, **options):
        name = f"pixel_nerf_net.encoder.{name}"
        bias = self.tensors[f"{name}.bias"] if self.tensors.has(f"{name}.bias") else None
        return F.conv2d(x, self.tensors[f"{name}.weight"], bias, **options)

    def separable(self, x, name, rate):
        channels = x.shape[1]
        return self.conv(self.conv(x, f"{name}.0", padding=rate, dilation=rate, groups=channels), f"{name}.1")

    def transposed(self, x, name):
        name = f"pixel_nerf_net.encoder.{name}.0"
        return F.relu(F.conv_transpose2d(x, self.tensors[f"{name}.weight"], self.tensors[f"{name}.bias"], stride=2))

    def stage(self, x, name):
        for layer in (0, 2, 4):
            x = F.relu(self.conv(x, f"{name}.{layer}", padding=1))
        return x

    def basic_block(self, x, name, stride, rate):
        y = F.relu(self.conv(x, f"{name}.conv1", stride=stride, padding=rate, dilation=rate))
        y = self.conv(y, f"{name}.conv2", padding=rate, dilation=rate)
        if self.tensors.has(f"pixel_nerf_net.encoder.{name}.downsample.0.weight"):
            x = self.conv(x, f"{name}.downsample.0", stride=stride)
        return F.relu(x + y)

    def encode(self, images):
        """Volumes (view, feature, depth, row, column) of images (view, 3, row, column) in [-1, 1]."""
        features = [images, F.relu(self.conv(images, "encoder.conv1", stride=2, padding=3))]
        x = F.max_pool2d(features[1], 3, 2, 1)
        for level in (1, 2, 3, 4):
            block = 0
            while self.tensors.has(f"pixel_nerf_net.encoder.encoder.layer{level}.{block}.conv1.weight"):
                stride = 2 if level in (2, 3) and block == 0 else 1
                x = self.basic_block(x, f"encoder.layer{level}.{block}", stride, 2 if level == 4 else 1)
                block += 1
            features.append(x)
        aspp = "decoder.aspp.0.convs"
        parts = [F.relu(self.conv(x, f"{aspp}.0.0"))]
        parts += [F.relu(self.separable(x, f"{aspp}.{index}.0", rate)) for index, rate in enumerate(RATES, 1)]
        pooled = F.relu(self.conv(x.mean((2, 3), keepdim=True), f"{aspp}.4.1"))
        parts.append(F.interpolate(pooled, x.shape[2:], mode="bilinear"))
        x = F.relu(self.conv(torch.cat(parts, 1), "decoder.aspp.0.project.0"))
        x = F.relu(self.separable(x, "decoder.aspp.1", 1))
        up = "decoder.modified_up"
        x = self.stage(torch.cat([features[4], features[5], x], 1), f"{up}.stage1")
        x = self.stage(torch.cat([features[3], self.transposed(x, f"{up}.upconv1")], 1), f"{up}.stage2")
        x = self.stage(torch.cat([features[2], self.transposed(x, f"{up}.upconv2")], 1), f"{up}.stage3")
        near = F.relu(self.conv(features[2], "decoder.block1.0"))
        x = F.relu(self.separable(torch.cat([x, near], 1), "decoder.block2.0", 1))
        head = "volume_head.up"
        x = self.stage(torch.cat([features[1], self.transposed(x, f"{head}.upconv1")], 1), f"{head}.stage1")
        x = self.stage(torch.cat([features[0], self.transposed(x, f"{head}.upconv2")], 1), f"{head}.stage2")
        x = F.relu(self.conv(x, "volume_head.reshape_conv"))
        return x.reshape(len(x), self.features, -1, *x.shape[2:])

    # Feature image

    def mlp(self, x):
        given = x
        for layer in range(3):
            name = f"pixel_nerf_net.mlp.layers.{layer}"
            x = F.linear(x, self.tensors[f"{name}.weight"], self.tensors[f"{name}.bias"])
            x = F.relu(x) if layer < 2 else x
        return torch.cat([F.relu(x[..., :1]), given + x[..., 1:]], -1)

    def feature_image(self, volumes, poses, weights, target, focal, ends):
        """Features (1, feature, row, column) at a target; the focal length in halves of the image's height, the ends of
        rays in focal lengths. Rays are cast at half the resolution."""
        near, far = ends
        side = volumes.shape[-1] // 2
        x, y = torch.meshgrid(torch.linspace(-1, 1, side), torch.linspace(1, -1, side), indexing="xy")
        directions = torch.stack([x, y, torch.full_like(x, -focal)], -1) @ target[:3, :3].T
        depths = torch.linspace(near, far, SAMPLES)
        points = target[:3, 3] + depths[:, None] * directions[:, :, None]
        rotations = poses[:, :3, :3].transpose(1, 2)
        centres = -torch.bmm(rotations, poses[:, :3, 3:])[..., 0]
        seen = torch.einsum("vij,hwsj->vhwsi", rotations, points) + centres[:, None, None, None]
        depth = -seen[..., 2]
        u, v = seen[..., 0] / depth * focal, -seen[..., 1] / depth * focal
        w = 2 * (depth - focal * near) / (focal * far - focal * near) - 1
        grid = torch.stack([u, v, -w], -1).reshape(len(poses), 1, 1, -1, 3)
        found = F.grid_sample(volumes, grid, align_corners=False)[:, :, 0, 0]
        fused = (weights[:, None, None] * found).sum(0).T
        radiance = self.mlp(fused).reshape(side, side, SAMPLES, -1)
        lengths = torch.cat([depths[1:] - depths[:-1], torch.tensor([1e10])])
        optical = radiance[..., 0] * lengths
        shares = (1 - torch.exp(-optical)) * torch.exp(-torch.cumsum(optical, -1))
        image = (shares[..., None] * radiance[..., 1:]).sum(2).permute(2, 0, 1)
        return F.interpolate(image[None], scale_factor=2, mode="bilinear", align_corners=True)

    # Denoiser

    def layer(self, name):
        name = f"denoiser.model.{name}"
        return self.tensors[f"{name}.weight"], self.tensors[f"{name}.bias"]

    def norm(self, x, name):
        return F.group_norm(x, min(32, x.shape[1] // 4), *self.layer(name), eps=1e-6)

    def block(self, x, name, embedding):
        given, x = x, F.silu(self.norm(x, f"{name}.norm0"))
        if name.endswith("_down"):
            given, x = F.avg_pool2d(given, 2), F.avg_pool2d(x, 2)
        if name.endswith("_up"):
            given, x = (F.interpolate(y, scale_factor=2, mode="nearest") for y in (given, x))
        x = F.conv2d(x, *self.layer(f"{name}.conv0"), padding=1)
        x = x + F.linear(embedding, *self.layer(f"{name}.affine"))[..., None, None]
        x = F.conv2d(F.silu(self.norm(x, f"{name}.norm1")), *self.layer(f"{name}.conv1"), padding=1)
        if self.tensors.has(f"denoiser.model.{name}.skip.weight"):
            given = F.conv2d(given, *self.layer(f"{name}.skip"))
        x = (x + given) * math.sqrt(0.5)
        if self.tensors.has(f"denoiser.model.{name}.qkv.weight"):
            qkv = F.conv2d(self.norm(x, f"{name}.norm2"), *self.layer(f"{name}.qkv"))
            q, k, v = qkv.reshape(len(x), x.shape[1], 3, -1).unbind(2)
            weights = torch.einsum("ncq,nck->nqk", q, k / math.sqrt(k.shape[1])).softmax(2)
            attended = torch.einsum("nqk,nck->ncq", weights, v).reshape(x.shape)
            x = (F.conv2d(attended, *self.layer(f"{name}.proj")) + x) * math.sqrt(0.5)
        return x

    def network(self, x, noise):
        count = self.frequency_count
        frequencies = (1 / 10000) ** (torch.arange(count) / (count - 1))
        waves = noise * frequencies
        embedding = torch.cat([waves.sin(), waves.cos()])[None]
        for name in ("map_layer0", "map_layer1"):
            embedding = F.silu(F.linear(embedding, *self.layer(name)))
        names = [name.split(".")[3] for name in self.tensors.shapes if name.startswith("denoiser.model.enc.")]
        skips, residual = [], x
        for name in dict.fromkeys(names):
            name = f"enc.{name}"
            if name.endswith("_conv"):
                x = F.conv2d(x, *self.layer(name), padding=1)
            elif name.endswith("_aux_residual"):
                weight, bias = self.layer(name)
                residual = F.avg_pool2d(F.conv2d(residual, weight, padding=1), 2) + bias[:, None, None]
                x = skips[-1] = residual = (x + residual) / math.sqrt(2)
                continue
            else:
                x = self.block(x, name, embedding)
            skips.append(x)
        names = [name.split(".")[3] for name in self.tensors.shapes if name.startswith("denoiser.model.dec.")]
        for name in dict.fromkeys(names):
            name = f"dec.{name}"
            if "_aux_" not in name:
                if "_block" in name:
                    x = torch.cat([x, skips.pop()], 1)
                x = self.block(x, name, embedding)
            elif name.endswith("_aux_norm"):
                x = F.silu(self.norm(x, name))
            else:
                x = F.conv2d(x, *self.layer(name), padding=1)
        return x

    def denoise(self, noisy, condition, sigma):
        """The denoised picture (1, 3, row, column); sigma a number."""
        norm = math.sqrt(sigma**2 + SIGMA_DATA**2)
        inputs = torch.cat([noisy, condition], 1) / norm
        output = self.network(inputs.float(), torch.tensor(math.log(sigma) / 4, dtype=torch.float32))
        return (SIGMA_DATA / norm) ** 2 * noisy + sigma * SIGMA_DATA / norm * output

    def sample(self, latents, condition, steps):
        """The published second-order sampler, state in double precision."""
        largest, smallest = (level ** (1 / 7) for level in LEVELS)
        seventh = [largest + index / (steps - 1) * (smallest - largest) for index in range(steps)]
        levels = [root**7 for root in seventh] + [0.0]
        x = latents.double() * levels[0]
        for index, (now, after) in enumerate(zip(levels, levels[1:])):
            slope = (x - self.denoise(x.float(), condition, now).double()) / now
            stepped = x + (after - now) * slope
            if index < steps - 1:
                there = (stepped - self.denoise(stepped.float(), condition, after).double()) / after
                stepped = x + (after - now) * (slope + there) / 2
            x = stepped
        return x


def normals(seed, shape):
    """viewfuse's noise at the start of a run (1, 3, row, column): numbers of variance 1, counted by row, column, channel."""
    _, channels, height, width = shape
    u, v = uniform_pairs(seed, np.arange(channels * height * width), np.arange(1))
    noise = torch.sqrt(-2 * torch.log(1 - u)) * torch.cos(2 * math.pi * v)
    return noise.reshape(height, width, channels).permute(2, 0, 1)[None]


# Commands


def timed(work, repeat):
    """What it gives, and the median of its times."""
    times = []
    for _ in range(repeat):
        start = now()
        result = work()
        times.append(now() - start)
    return result, sorted(times)[len(times) // 2]


def render(options):
    model = Genvs("published")
    images, poses, focal, _ = read_scene(options.scene, [*options.sources, options.target])
    focal = 2 * focal / images.shape[2]
    ends = [end / focal for end in options.near_far]
    weights = torch.full((len(options.sources),), 1 / len(options.sources))
    latents = normals(options.seed, images[-1:].shape)
    # Once before the clock runs: parameters are computed, threads started.
    volumes = model.encode(images[:-1])
    volumes, encode_time = timed(lambda: model.encode(images[:-1]), options.repeat)
    image, feature_time = timed(
        lambda: model.feature_image(volumes, poses[:-1], weights, poses[-1], focal, ends), options.repeat
    )
    model.denoise(latents, image, 1.0)
    _, call_time = timed(lambda: model.denoise(latents, image, 1.0), options.repeat)
    result = {
        "torch": torch.__version__,
        "blas": "mkl" if torch.backends.mkl.is_available() else "other",
        "instructions": torch.backends.cpu.get_cpu_capability(),
        "threads": torch.get_num_threads(),
        "device": torch.cuda.get_device_name() if pixelnerf.DEVICE.type == "cuda" else "cpu",
        "precision": options.precision,
        "python": platform.python_version(),
        "encode": encode_time,
        "features": feature_time,
        "call": call_time,
    }
    if options.steps:
        picture, picture_time = timed(lambda: model.sample(latents, image, options.steps), 1)
        result["picture"] = feature_time + picture_time
        result["calls"] = 2 * options.steps - 1
    print(json.dumps(result))
    if options.steps:
        picture = (0.5 * (picture[0] + 1)).float().clamp(0, 1).permute(1, 2, 0).cpu()
        if options.output:
            levels = (picture.numpy() * 255 + 0.5).astype(np.uint8)
            Image.fromarray(levels).save(options.output)
        if options.compare:
            compare(options.compare, picture.reshape(-1, 3).numpy())


def smooth_images(count, side):
    """Random images (view, 3, row, column) of 8 bits without sharp edges."""
    noise = torch.rand(count, 3, side // 8, side // 8)
    return (255 * F.interpolate(noise, (side, side), mode="bicubic").clamp(0, 1)).round().to(torch.uint8)


def look_at(azimuth, height, distance):
    """Pose (y up, z backward) of a camera that looks at the origin."""
    eye = torch.tensor([math.cos(azimuth), math.sin(azimuth), height])
    backward = F.normalize(eye, dim=0)
    right = F.normalize(torch.linalg.cross(torch.tensor([0.0, 0.0, 1.0]), backward), dim=0)
    pose = torch.eye(4)
    pose[:3] = torch.stack([right, torch.linalg.cross(backward, right), backward, distance * backward], 1)
    return pose


def error_weights(poses, target, of_axes):
    """Inverse angles between cameras: between their principal axes, or of the whole rotation."""
    cosines = [pose[:3, 2] @ target[:3, 2] for pose in poses]
    if not of_axes:
        cosines = [((pose[:3, :3].T @ target[:3, :3]).trace() - 1) / 2 for pose in poses]
    weights = 1 / (torch.stack(cosines).double().acos() / math.pi + 1e-6)
    return (weights / weights.sum()).float()


def write(path):
    """Reference values of the small member: the tensors of the official network's file of the same kind."""
    torch.manual_seed(1)
    model, side, focal = Genvs("small"), 64, 2.05078125
    poses = torch.stack([look_at(azimuth, height, 1.3 * focal) for azimuth, height in ((0, 0.3), (2, 0.6), (4.2, 0.1))])
    target = look_at(1.2, 0.4, 1.3 * focal)
    tensors = {
        "images": smooth_images(len(poses), side),
        "src_poses": poses,
        "tgt_pose": target,
        "focal_normalized": torch.tensor([focal]),
        "mlp_in": 1.5 * torch.randn(128, model.features),
        "latents": torch.randn(1, 3, side, side),
        "denoise_sigma": torch.tensor([0.002, 0.05, 0.5, 5.0, 80.0]),
    }
    volumes = model.encode(tensors["images"].float() / 127.5 - 1)
    tensors["volume_index"] = torch.randint(volumes.numel(), (1024,))
    tensors["volume_value"] = volumes.flatten()[tensors["volume_index"]]
    tensors["mlp_out"] = model.mlp(tensors["mlp_in"])
    seen = lambda weights: model.feature_image(volumes, poses, weights, target, focal, ENDS)
    tensors["feature_image_index"] = index = torch.randint(model.features * side**2, (1024,))
    tensors["feature_image_value.baseline_mean"] = seen(torch.full((3,), 1 / 3)).flatten()[index]
    tensors["feature_image_value.error_weighing_alpha=1.0"] = seen(error_weights(poses, target, False)).flatten()[index]
    condition = seen(error_weights(poses, target, True)).half()
    tensors["feature_image_full.error_alpha1_half"] = condition[0]
    tensors["denoise_index"] = torch.randint(3 * side**2, (512,))
    for level in tensors["denoise_sigma"]:
        denoised = model.denoise(tensors["latents"] * level, condition.float(), float(level))
        tensors[f"denoise_value.{float(level):.3g}"] = denoised.flatten()[tensors["denoise_index"]]
    tensors["sample_4_steps"] = model.sample(tensors["latents"], condition.float(), 4)
    save_file({name: tensor.contiguous() for name, tensor in tensors.items()}, path, {"member": "small"})


def check(path):
    """Compares with reference values."""
    expected, worst = load_file(path), 0.0
    with safe_open(path, "pt") as file:
        model = Genvs((file.metadata() or {}).get("member", "published"))
    focal = expected["focal_normalized"].item()

    def report(name, ours, theirs):
        nonlocal worst
        error = ((ours - theirs).abs().max() / theirs.abs().max()).item()
        worst = max(worst, error)
        print(f"{name:30} {error:.1e} of the largest value")

    volumes = model.encode(expected["images"].float() / 127.5 - 1)
    report("volumes", volumes.flatten()[expected["volume_index"]], expected["volume_value"])
    report("points", model.mlp(expected["mlp_in"]), expected["mlp_out"])
    poses, target = expected["src_poses"], expected["tgt_pose"]
    mean = torch.full((len(poses),), 1 / len(poses))
    for name, weights in (("baseline_mean", mean), ("error_weighing_alpha=1.0", error_weights(poses, target, False))):
        image = model.feature_image(volumes, poses, weights, target, focal, ENDS)
        theirs = expected[f"feature_image_value.{name}"]
        report(f"features {name}", image.flatten()[expected["feature_image_index"]], theirs)
    condition = expected["feature_image_full.error_alpha1_half"].float()[None]
    for name in (name for name in expected if name.startswith("denoise_value.")):
        level = float(name.removeprefix("denoise_value."))
        denoised = model.denoise(expected["latents"] * level, condition, level)
        report(f"denoised at level {level}", denoised.flatten()[expected["denoise_index"]], expected[name])
    report("picture", model.sample(expected["latents"], condition, 4), expected["sample_4_steps"])
    if not worst < 1e-3:
        raise SystemExit("differs from the reference values")


def main():
    numbers = lambda kind: lambda text: [kind(word) for word in text.split(",")]
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", nargs="?", type=Path, help="SRN folder: rgb/, pose/, intrinsics.txt; 128x128")
    parser.add_argument("--check", metavar="FILE", help="compare with reference values instead of rendering")
    parser.add_argument("--write", metavar="FILE", help="write the reference values of the small member")
    parser.add_argument("--sources", type=numbers(int), default=[0, 8, 16], help="numbers of the source views")
    parser.add_argument("--target", type=int, default=20, help="number of the view to render")
    parser.add_argument("--near-far", type=numbers(float), default=[0.8, 1.8])
    parser.add_argument("--steps", type=int, default=25, help="of the sampler; 0: no picture")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--repeat", type=int, default=1, help="times of the parts are medians of so many")
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
        elif options.write:
            write(options.write)
        elif options.scene:
            render(options)
        else:
            parser.error("a scene, --check FILE or --write FILE")


if __name__ == "__main__":
    main()
