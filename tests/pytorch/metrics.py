#!/usr/bin/env python3
"""The networks of LPIPS, DISTS and FID in plain PyTorch, parameters by formula: where tests/data/metrics/networks.json is from.

Written after torchvision's architectures and the published metrics (richzhang/PerceptualSimilarity, dingkeyan93/DISTS,
mseitzer/pytorch-fid). The heads are viewfuse's copies of the published ones. Needs torch, numpy and pillow (on Debian
python3-torch, python3-numpy, python3-pil).

    metrics.py > tests/data/metrics/networks.json
"""

import json
import math
import struct
from pathlib import Path

import numpy as np
import torch
import torch.nn.functional as F
from PIL import Image

ROOT = Path(__file__).resolve().parents[2]
HEADS = ROOT / "host/src/metrics/heads"
PICTURES = ROOT / "tests/data/metrics"
PAIRS = ("similar", "noisy")


def by_formula(name, shape):
    """A tensor computed from its name; the rule is in host/src/formula.rs."""
    h = 0xCBF29CE484222325
    for byte in name.encode():
        h = (h ^ byte) * 0x100000001B3 % 2**64
    with np.errstate(over="ignore"):
        z = np.uint64(h) + np.arange(1, math.prod(shape) + 1, dtype=np.uint64) * np.uint64(0x9E3779B97F4A7C15)
        z = (z ^ z >> np.uint64(30)) * np.uint64(0xBF58476D1CE4E5B9)
        z = (z ^ z >> np.uint64(27)) * np.uint64(0x94D049BB133111EB)
        z = z ^ z >> np.uint64(31)
    u = ((z >> np.uint64(40)).astype(np.float64) - 2**23) / 2**23
    leaf = name.rsplit(".", 1)[-1]
    if leaf == "running_var":
        value = 1 + 0.25 * u
    elif leaf in ("running_mean", "bias"):
        value = 0.125 * u
    elif len(shape) > 1:
        value = np.float32(math.sqrt(3 / math.prod(shape[1:]))) * u.astype(np.float32)
    else:
        value = 1 + 0.125 * u
    return torch.from_numpy(value.astype(np.float32).reshape(shape))


def heads(file):
    """The tensors of a safetensors file."""
    data = (HEADS / file).read_bytes()
    size = struct.unpack("<Q", data[:8])[0]
    tensors = {}
    for name, facts in json.loads(data[8 : 8 + size]).items():
        first, end = facts["data_offsets"]
        values = np.frombuffer(data[8 + size + first : 8 + size + end], dtype="<f4")
        tensors[name] = torch.from_numpy(values.copy()).flatten()
    return tensors


def conv(x, name, channels, side, stride=1, padding=0, prefix=""):
    name = prefix + name
    weight = by_formula(f"{name}.weight", (channels, x.shape[1], side, side))
    return F.relu(F.conv2d(x, weight, by_formula(f"{name}.bias", (channels,)), stride, padding))


def alex(x):
    taps = [conv(x, "features.0", 64, 11, 4, 2)]
    taps.append(conv(F.max_pool2d(taps[-1], 3, 2), "features.3", 192, 5, 1, 2))
    taps.append(conv(F.max_pool2d(taps[-1], 3, 2), "features.6", 384, 3, 1, 1))
    taps.append(conv(taps[-1], "features.8", 256, 3, 1, 1))
    return taps + [conv(taps[-1], "features.10", 256, 3, 1, 1)]


def vgg(x, halve, prefix=""):
    taps = []
    for channels, places in ((64, (0, 2)), (128, (5, 7)), (256, (10, 12, 14)), (512, (17, 19, 21)), (512, (24, 26, 28))):
        x = halve(x) if taps else x
        for place in places:
            x = conv(x, f"features.{place}", channels, 3, 1, 1, prefix)
        taps.append(x)
    return taps


def squeeze(x):
    def fire(x, place, narrow, wide):
        x = conv(x, f"features.{place}.squeeze", narrow, 1)
        name = f"features.{place}.expand"
        return torch.cat([conv(x, f"{name}1x1", wide, 1), conv(x, f"{name}3x3", wide, 3, 1, 1)], 1)

    def halve(x):
        return F.max_pool2d(x, 3, 2, ceil_mode=True)

    taps = [conv(x, "features.0", 64, 3, 2)]
    taps.append(fire(fire(halve(taps[-1]), 3, 16, 64), 4, 16, 64))
    taps.append(fire(fire(halve(taps[-1]), 6, 32, 128), 7, 32, 128))
    taps.append(fire(halve(taps[-1]), 9, 48, 192))
    taps.append(fire(taps[-1], 10, 48, 192))
    taps.append(fire(taps[-1], 11, 64, 256))
    return taps + [fire(taps[-1], 12, 64, 256)]


def lpips(trunk, file, pictures):
    shift, scale = (torch.tensor(v).view(1, 3, 1, 1) for v in ((-0.030, -0.088, -0.188), (0.458, 0.448, 0.450)))
    lines = heads(file)
    taps = [trunk((2 * picture - 1 - shift) / scale) for picture in pictures]
    total = 0
    for index, (p, t) in enumerate(zip(*taps)):
        p, t = (v.double() / (v.double().square().sum(1, keepdim=True).sqrt() + 1e-10) for v in (p, t))
        total += ((p - t).square() * lines[f"lin{index}.model.1.weight"].double().view(1, -1, 1, 1)).sum(1).mean().item()
    return total


def dists(pictures):
    mean, deviation = (torch.tensor(v).view(1, 3, 1, 1) for v in ((0.485, 0.456, 0.406), (0.229, 0.224, 0.225)))

    def halve(x):
        a = torch.tensor([0.5, 1.0, 0.5])
        blur = (a[:, None] * a[None, :] / 4).repeat(x.shape[1], 1, 1, 1)
        return (F.conv2d(x**2, blur, stride=2, padding=1, groups=x.shape[1]) + 1e-12).sqrt()

    maps = [[p] + vgg((p - mean) / deviation, halve, "vgg16.") for p in pictures]
    weights = heads("dists.safetensors")
    alpha, beta = weights["alpha"].double(), weights["beta"].double()
    similar, c, at = 0, 1e-6, 0
    for p, t in zip(*maps):
        p, t = p.double().flatten(2)[0], t.double().flatten(2)[0]
        m, n = p.mean(1), t.mean(1)
        own = slice(at, at + len(m))
        at += len(m)
        covariance = (p * t).mean(1) - m * n
        structure = (2 * covariance + c) / (p.var(1, unbiased=False) + t.var(1, unbiased=False) + c)
        similar += (alpha[own] * (2 * m * n + c) / (m**2 + n**2 + c) + beta[own] * structure).sum()
    return (1 - similar / (alpha.sum() + beta.sum())).item()


def inception(x, is_fid):
    """The mean over pixels of what comes out of Mixed_7c."""

    def basic(x, name, channels, window, stride=1, padding=None):
        window = window if isinstance(window, tuple) else (window, window)
        padding = tuple(side // 2 for side in window) if padding is None else padding
        x = F.conv2d(x, by_formula(f"{name}.conv.weight", (channels, x.shape[1], *window)), None, stride, padding)
        leaves = ("running_mean", "running_var", "weight", "bias")
        return F.relu(F.batch_norm(x, *(by_formula(f"{name}.bn.{leaf}", (channels,)) for leaf in leaves), eps=0.001))

    def mean(x):
        return F.avg_pool2d(x, 3, 1, 1, count_include_pad=not is_fid)

    def chain(x, name, *layers):
        for leaf, channels, window in layers:
            x = basic(x, f"{name}.{leaf}", channels, window)
        return x

    row, column = (1, 7), (7, 1)
    x = F.interpolate(x, size=(299, 299), mode="bilinear", align_corners=False) * 2 - 1
    x = basic(x, "Conv2d_1a_3x3", 32, 3, 2, 0)
    x = basic(basic(x, "Conv2d_2a_3x3", 32, 3, 1, 0), "Conv2d_2b_3x3", 64, 3)
    x = F.max_pool2d(x, 3, 2)
    x = F.max_pool2d(basic(basic(x, "Conv2d_3b_1x1", 80, 1), "Conv2d_4a_3x3", 192, 3, 1, 0), 3, 2)
    for n, pooled in (("Mixed_5b", 32), ("Mixed_5c", 64), ("Mixed_5d", 64)):
        x = torch.cat(
            [
                basic(x, f"{n}.branch1x1", 64, 1),
                chain(x, n, ("branch5x5_1", 48, 1), ("branch5x5_2", 64, 5)),
                chain(x, n, ("branch3x3dbl_1", 64, 1), ("branch3x3dbl_2", 96, 3), ("branch3x3dbl_3", 96, 3)),
                basic(mean(x), f"{n}.branch_pool", pooled, 1),
            ],
            1,
        )
    n = "Mixed_6a"
    double = chain(x, n, ("branch3x3dbl_1", 64, 1), ("branch3x3dbl_2", 96, 3))
    double = basic(double, f"{n}.branch3x3dbl_3", 96, 3, 2, 0)
    x = torch.cat([basic(x, f"{n}.branch3x3", 384, 3, 2, 0), double, F.max_pool2d(x, 3, 2)], 1)
    for n, c in (("Mixed_6b", 128), ("Mixed_6c", 160), ("Mixed_6d", 160), ("Mixed_6e", 192)):
        single = chain(x, n, ("branch7x7_1", c, 1), ("branch7x7_2", c, row), ("branch7x7_3", 192, column))
        layers = [(f"branch7x7dbl_{i + 2}", 192 if i == 3 else c, column if i % 2 == 0 else row) for i in range(4)]
        double = chain(x, n, ("branch7x7dbl_1", c, 1), *layers)
        pooled = basic(mean(x), f"{n}.branch_pool", 192, 1)
        x = torch.cat([basic(x, f"{n}.branch1x1", 192, 1), single, double, pooled], 1)
    n = "Mixed_7a"
    single = basic(basic(x, f"{n}.branch3x3_1", 192, 1), f"{n}.branch3x3_2", 320, 3, 2, 0)
    double = chain(x, n, ("branch7x7x3_1", 192, 1), ("branch7x7x3_2", 192, row), ("branch7x7x3_3", 192, column))
    double = basic(double, f"{n}.branch7x7x3_4", 192, 3, 2, 0)
    x = torch.cat([single, double, F.max_pool2d(x, 3, 2)], 1)
    for n in ("Mixed_7b", "Mixed_7c"):
        single = basic(x, f"{n}.branch3x3_1", 384, 1)
        double = chain(x, n, ("branch3x3dbl_1", 448, 1), ("branch3x3dbl_2", 384, 3))
        pooled = F.max_pool2d(x, 3, 1, 1) if is_fid and n == "Mixed_7c" else mean(x)
        sides = ((1, 3), (3, 1))
        x = torch.cat(
            [
                basic(x, f"{n}.branch1x1", 320, 1),
                *(basic(single, f"{n}.branch3x3_2{ab}", 384, side) for ab, side in zip("ab", sides)),
                *(basic(double, f"{n}.branch3x3dbl_3{ab}", 384, side) for ab, side in zip("ab", sides)),
                basic(pooled, f"{n}.branch_pool", 192, 1),
            ],
            1,
        )
    return x.double().mean((0, 2, 3))


def picture(name):
    levels = np.asarray(Image.open(PICTURES / f"{name}.png").convert("RGB"))
    return torch.from_numpy(levels.copy()).permute(2, 0, 1)[None].float() / 255


@torch.no_grad()
def main():
    pairs = [[picture(f"{name}_{of}") for of in ("pred", "truth")] for name in PAIRS]
    result = {
        "note": f"tests/pytorch/metrics.py, PyTorch {torch.__version__}: parameters by formula, published heads.",
        "pairs": PAIRS,
        "lpips-alex": [lpips(alex, "lpips_alex.safetensors", pair) for pair in pairs],
        "lpips-vgg": [lpips(lambda x: vgg(x, lambda x: F.max_pool2d(x, 2)), "lpips_vgg.safetensors", p) for p in pairs],
        "lpips-squeeze": [lpips(squeeze, "lpips_squeeze.safetensors", pair) for pair in pairs],
        "dists": [dists(pair) for pair in pairs],
    }
    # Every 31st of the 2048 features of the prediction of the second pair.
    for name, is_fid in (("inception-fid", True), ("inception-torchvision", False)):
        result[name] = inception(pairs[1][0], is_fid)[::31].tolist()
    print(json.dumps(result, indent=1))


main()
