#!/usr/bin/env python3
"""GeNVS in plain PyTorch, to compare viewfuse with: the same networks, parameters, samples, noise levels and picture.

Written after the papers (Chan et al.: "GeNVS", 2023; Karras et al.: "Elucidating the design space of diffusion-based
generative models", 2022) and the structure of the code of "Pay Attention to Where You Looked": the trunk and its
decoder without batch norm, volumes looked up with grid_sample, each layer one call, the published second-order sampler
with its state in double precision.

Needs torch, numpy and safetensors (pip install torch numpy safetensors; on Debian python3-torch, python3-numpy,
python3-safetensors). Examples:

    genvs.py --check genvs_srn.safetensors              # against numbers of the official code
    genvs.py --time                                     # encoder, feature image, one denoiser call
    genvs.py --time --picture 25 --write picture.safetensors
"""

import argparse
import json
import math
import time

import numpy as np
import torch
import torch.nn.functional as F
from safetensors.torch import load_file, save_file

from pixelnerf import by_formula

LEVELS = ((64, 3), (128, 4), (256, 6), (512, 3))  # channels and blocks of the trunk's levels
RATES = (12, 24, 36)  # of the dilated convolutions
FEATURES, DEPTH, SAMPLES = 16, 64, 64
SIGMA_DATA = 0.5
GAINS = {"pixel_nerf_net.encoder.volume_head.reshape_conv.weight": 8.0, "pixel_nerf_net.mlp.layers.2.weight": 4.0}


class Tensors(dict):
    """Parameters by formula, computed when first asked for; shapes from a manifest."""

    def __init__(self, manifest):
        self.shapes = {tensor["name"]: tensor["shape"] for tensor in json.load(open(manifest))["tensors"]}

    def __missing__(self, name):
        self[name] = by_formula(name, self.shapes[name], GAINS.get(name, 1.0))
        return self[name]

    def has(self, name):
        return name in self.shapes


class Genvs:
    def __init__(self, tensors):
        self.tensors = tensors

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
        """Volumes (view, 16, 64, 128, 128) of images (view, 3, 128, 128) in [-1, 1]."""
        features = [images, F.relu(self.conv(images, "encoder.conv1", stride=2, padding=3))]
        x = F.max_pool2d(features[1], 3, 2, 1)
        for level, (_, count) in enumerate(LEVELS, 1):
            for block in range(count):
                stride = 2 if level in (2, 3) and block == 0 else 1
                x = self.basic_block(x, f"encoder.layer{level}.{block}", stride, 2 if level == 4 else 1)
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
        return x.reshape(len(x), FEATURES, DEPTH, *x.shape[2:])

    # Feature image

    def mlp(self, x):
        given = x
        for layer in range(3):
            name = f"pixel_nerf_net.mlp.layers.{layer}"
            x = F.linear(x, self.tensors[f"{name}.weight"], self.tensors[f"{name}.bias"])
            x = F.relu(x) if layer < 2 else x
        return torch.cat([F.relu(x[..., :1]), given + x[..., 1:]], -1)

    def feature_image(self, volumes, poses, weights, target, focal, near, far, samples=SAMPLES):
        """Features (16, 128, 128) at a target, with normalised focal length; rays at half the resolution."""
        side = volumes.shape[-1] // 2
        x, y = torch.meshgrid(torch.linspace(-1, 1, side), torch.linspace(1, -1, side), indexing="xy")
        directions = torch.stack([x, y, torch.full_like(x, -focal)], -1) @ target[:3, :3].T
        depths = torch.linspace(near, far, samples)
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
        radiance = self.mlp(fused).reshape(side, side, samples, -1)
        lengths = torch.cat([depths[1:] - depths[:-1], torch.tensor([1e10])])
        optical = radiance[..., 0] * lengths
        shares = (1 - torch.exp(-optical)) * torch.exp(-torch.cumsum(optical, -1))
        image = (shares[..., None] * radiance[..., 1:]).sum(2).permute(2, 0, 1)
        return F.interpolate(image[None], scale_factor=2, mode="bilinear", align_corners=True)[0]

    # Denoiser

    def layer(self, name):
        name = f"denoiser.model.{name}"
        return self.tensors[f"{name}.weight"], self.tensors[f"{name}.bias"]

    def norm(self, x, name):
        return F.group_norm(x, min(32, x.shape[1] // 4), *self.layer(name), eps=1e-6)

    def block(self, x, name, embedding):
        resample = F.avg_pool2d if name.endswith("_down") else None
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
        frequencies = (1 / 10000) ** (torch.arange(64) / 63)
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
        """The denoised picture (1, 3, 128, 128); sigma a number."""
        norm = math.sqrt(sigma**2 + SIGMA_DATA**2)
        inputs = torch.cat([noisy, condition], 1) / norm
        output = self.network(inputs.float(), torch.tensor(math.log(sigma) / 4, dtype=torch.float32))
        return (SIGMA_DATA / norm) ** 2 * noisy + sigma * SIGMA_DATA / norm * output

    def sample(self, latents, condition, steps):
        """The published second-order sampler, state in double precision."""
        seventh = [80 ** (1 / 7) + i / (steps - 1) * (0.002 ** (1 / 7) - 80 ** (1 / 7)) for i in range(steps)]
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


def timed(what, work, repeat):
    times = []
    for _ in range(repeat):
        start = time.perf_counter()
        result = work()
        times.append(time.perf_counter() - start)
    print(f"{what}: {sorted(times)[len(times) // 2]:.3f} s (median of {repeat})")
    return result


def worst(what, actual, expected):
    print(f"{what}: {(actual - expected).abs().max():.2e} of a largest {expected.abs().max():.3g}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--manifest", default="/work/shared/fixtures/genvs_manifest.json")
    parser.add_argument("--check", required=True)
    parser.add_argument("--threads", type=int, default=2)
    arguments = parser.parse_args()
    torch.set_num_threads(arguments.threads)
    model = Genvs(Tensors(arguments.manifest))
    given = load_file(arguments.check)
    focal = given["focal_normalized"].item()
    with torch.inference_mode():
        images = given["images"].float() / 127.5 - 1
        timed("encode", lambda: model.encode(images), 1)
        volumes = timed("encode", lambda: model.encode(images), 3)
        worst("volumes", volumes.flatten()[given["volume_index"]], given["volume_value"])
        worst("mlp", model.mlp(given["mlp_in"]), given["mlp_out"])
        mean = torch.full((3,), 1 / 3)
        image = timed("features", lambda: model.feature_image(volumes, given["src_poses"], mean, given["tgt_pose"], focal, 0.8 / focal, 1.8 / focal), 1)
        worst("features", image.flatten()[given["feature_image_index"]], given["feature_image_value.baseline_mean"])
        condition = given["feature_image_full.error_alpha1_half"].float()[None]
        for sigma in given["denoise_sigma"]:
            noisy = given["latents"] * sigma
            name = {0.002: "0.002", 0.05: "0.05", 0.5: "0.5", 5.0: "5.0", 80.0: "80.0"}[round(float(sigma), 4)]
            denoised = timed("denoise", lambda: model.denoise(noisy, condition, float(sigma)), 1)
            worst(f"denoise {name}", denoised.flatten()[given["denoise_index"]], given[f"denoise_value.{name}"])
        timed("denoise", lambda: model.denoise(noisy, condition, float(sigma)), 5)
        picture = timed("sample 4", lambda: model.sample(given["latents"], condition, 4), 1)
        worst("sample", picture, given["sample_4_steps"])


if __name__ == "__main__":
    main()
