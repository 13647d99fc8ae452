#!/usr/bin/env python3
"""Steps of training a PixelNeRF in plain PyTorch, to compare viewfuse's with: the same network, and batches of the same sizes.

As `viewfuse-lab train pixelnerf`: of each of some objects a few views are sources, rays of the others targets; a first pass without
gradients places the samples of the second; mean square error; gradients limited to a norm of 1; Adam; constant batch norms. The
network is that of pixelnerf.py, for all objects of a batch at once; the first thing that this program does is to compare the two.

    train_pixelnerf.py FOLDER --model host/models/pixelnerf_cars.safetensors --steps 20

FOLDER has SRN folders of square pictures. Needs what pixelnerf.py needs.
"""

import argparse
import json
import math
import platform
import time
from pathlib import Path

import torch
import torch.nn.functional as F

from pixelnerf import FREQUENCY, PixelNerf, cast_rays, parameters, read_scene

# Numbers of sources, one of which is drawn at each step, as in host/train/src/pixelnerf_learner.rs.
SOURCE_COUNTS = (1, 2, 3, 3, 3, 3, 4, 6)
RATE, MAX_GRADIENT = 1e-3, 1.0


class Batched(PixelNerf):
    """PixelNerf for points (object, point, 3) of objects with as many views each; poses are (object, view, 4, 4)."""

    def set_objects(self, poses, focal, centre):
        self.rotation = poses[..., :3, :3].transpose(2, 3)
        self.translation = -(self.rotation @ poses[..., :3, 3:])[..., 0]
        self.focal, self.centre = focal, centre

    def radiance(self, network, points, directions):
        objects, views = self.rotation.shape[:2]
        rotated = points[:, None] @ self.rotation.transpose(2, 3)
        turned = directions[:, None] @ self.rotation.transpose(2, 3)
        frequencies = FREQUENCY * 2.0 ** torch.arange(self.octaves).repeat_interleave(2)
        phases = torch.tensor([0.0, math.pi / 2]).repeat(self.octaves)
        waves = torch.sin(rotated[..., None, :] * frequencies[:, None] + phases[:, None]).flatten(3)
        seen = rotated + self.translation[:, :, None]
        pixels = seen[..., :2] / -seen[..., 2:] * torch.tensor([self.focal, -self.focal]) + self.centre
        rows, columns = self.latents.shape[-2:]
        places = (pixels - self.pixel_centre) * (2.0 / self.side) * torch.tensor([columns / (columns - 1), rows / (rows - 1)]) - 1
        latents = F.grid_sample(
            self.latents, places.flatten(0, 1)[:, :, None], mode="bilinear", padding_mode="border", align_corners=True
        )[..., 0].transpose(1, 2)
        raw = self.mixed(network, torch.cat([rotated, waves, turned], -1), latents.unflatten(0, (objects, views)))
        return torch.cat([torch.sigmoid(raw[..., :3]), F.relu(raw[..., 3:])], -1)

    def mixed(self, network, x, latents):
        x = self.linear(f"{network}.lin_in", x)
        for block in range(self.blocks):
            if block == self.injected:
                x = x.mean(1)
            if block < self.injected:
                x = x + self.linear(f"{network}.lin_z.{block}", latents)
            inside = self.linear(f"{network}.blocks.{block}.fc_0", F.relu(x))
            x = x + self.linear(f"{network}.blocks.{block}.fc_1", F.relu(inside))
        return self.linear(f"{network}.lin_out", F.relu(x))

    def composite(self, rays, depths):
        """Weights (object, ray, sample) and colours over white of rays (object, ray, 8)."""
        points = rays[:, :, None, :3] + depths[..., None] * rays[:, :, None, 3:6]
        directions = rays[:, :, None, 3:6].expand_as(points)
        radiance = self.radiance("mlp_coarse", points.flatten(1, 2), directions.flatten(1, 2)).reshape(*depths.shape, 4)
        lengths = torch.cat([depths[..., 1:], rays[..., 7:]], -1) - depths
        behind = torch.exp(-torch.cumsum(lengths * radiance[..., 3], -1))
        weights = torch.cat([torch.ones_like(behind[..., :1]), behind[..., :-1]], -1) - behind
        return weights, (weights[..., None] * radiance[..., :3]).sum(2) + 1 - weights.sum(2)[..., None]


def placed(rays, coarse, weights, count):
    """The coarse depths and `count` more where the weights are, sorted."""
    cumulated = torch.cumsum(weights + 1e-5, -1)
    share = (torch.arange(count) + torch.rand(*coarse.shape[:2], count)) / count * cumulated[..., -1:]
    place = torch.searchsorted(cumulated, share, right=True).clamp(max=coarse.shape[2] - 1)
    part = (rays[..., 7:] - rays[..., 6:7]) / coarse.shape[2]
    return torch.sort(torch.cat([coarse, rays[..., 6:7] + part * (place + torch.rand_like(share))], -1), -1)[0]


class Data:
    def __init__(self, folder, near_far, pixel_centre):
        scenes = []
        for path in sorted(path for path in folder.iterdir() if (path / "pose").is_dir()):
            scenes.append(read_scene(path, range(len(list((path / "pose").glob("*.txt"))))))
        self.images = torch.stack([scene[0] for scene in scenes])
        self.poses = torch.stack([scene[1] for scene in scenes])
        self.focal, self.centre = scenes[0][2:]
        side = self.images.shape[-1]
        cast = lambda pose: cast_rays(pose, self.focal, self.centre, 1.0, side, pixel_centre, near_far)
        self.rays = torch.stack([torch.stack([cast(pose) for pose in poses]) for poses in self.poses])

    def batch(self, objects, views, rays):
        """Pictures (object, view, 3, side, side) and poses of the sources, rays (object, ray, 8), colours."""
        scene = torch.randint(len(self.images), (objects,))
        order = torch.argsort(torch.rand(objects, self.images.shape[1]), 1)
        sources, others = order[:, :views], order[:, views:]
        target = others.gather(1, torch.randint(others.shape[1], (objects, rays)))
        pixel = torch.randint(self.rays.shape[2], (objects, rays))
        colours = (self.images.flatten(3)[scene[:, None], target, :, pixel] + 1) / 2
        cast = self.rays[scene[:, None], target, pixel]
        return self.images[scene[:, None], sources], self.poses[scene[:, None], sources], cast, colours


def forward(network, batch, options):
    images, poses, rays, truth = batch
    network.encode(images.flatten(0, 1))
    with torch.no_grad():
        part = (rays[..., 7:] - rays[..., 6:7]) / options.coarse
        coarse = rays[..., 6:7] + part * (torch.arange(options.coarse) + torch.rand(*rays.shape[:2], options.coarse))
        weights, _ = network.composite(rays, coarse)
        depths = placed(rays, coarse, weights, options.fine)
    _, colours = network.composite(rays, depths)
    return F.mse_loss(colours, truth)


@torch.no_grad()
def check(network, plain, data):
    """Compares the batched network with that of pixelnerf.py, object by object."""
    images, poses, rays, _ = data.batch(2, 3, 16)
    depths = rays[..., 6:7] + (rays[..., 7:] - rays[..., 6:7]) * (torch.arange(8) + 0.5) / 8
    network.encode(images.flatten(0, 1))
    network.set_objects(poses, data.focal, data.centre)
    _, colours = network.composite(rays, depths)
    for own in range(2):
        plain.encode(images[own])
        plain.set_views(poses[own], data.focal, data.centre, torch.full((3,), 1 / 3))
        _, expected, _ = plain.look("mlp_coarse", rays[own], depths[own], 100000)
        difference = (colours[own] - expected).abs().max().item()
        if not difference < 1e-4:
            raise SystemExit(f"the batched network differs from pixelnerf.py's by {difference}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", type=Path, help="a folder of SRN folders")
    parser.add_argument("--model", required=True, help=".safetensors checkpoint with one point network")
    parser.add_argument("--steps", type=int, default=16)
    parser.add_argument("--objects", type=int, default=8)
    parser.add_argument("--rays", type=int, default=64, help="of each object")
    parser.add_argument("--coarse", type=int, default=32)
    parser.add_argument("--fine", type=int, default=16)
    parser.add_argument("--threads", type=int)
    options = parser.parse_args()
    if options.threads:
        torch.set_num_threads(options.threads)
    torch.manual_seed(0)
    tensors, pixel_centre, source_side, has_pool = parameters(options.model)
    data = Data(options.scenes, (0.8, 1.8), pixel_centre)
    network = Batched(tensors, pixel_centre, source_side, has_pool)
    check(network, PixelNerf(tensors, pixel_centre, source_side, has_pool), data)
    learned = [tensor for name, tensor in tensors.items() if not name.endswith(("running_mean", "running_var"))]
    learned = [tensor.requires_grad_() for tensor in learned if tensor.is_floating_point()]
    adam = torch.optim.Adam(learned, lr=RATE)
    # The first steps start threads and fill caches.
    losses, warm = [], 3
    for step in range(warm + options.steps):
        if step == warm:
            start, computed = time.perf_counter(), time.process_time()
        views = SOURCE_COUNTS[step % len(SOURCE_COUNTS)]
        batch = data.batch(options.objects, views, options.rays)
        network.set_objects(batch[1], data.focal, data.centre)
        loss = forward(network, batch, options)
        adam.zero_grad(set_to_none=True)
        loss.backward()
        torch.nn.utils.clip_grad_norm_(learned, MAX_GRADIENT)
        adam.step()
        losses.append(loss.item())
    result = {
        "torch": torch.__version__,
        "blas": "mkl" if torch.backends.mkl.is_available() else "other",
        "instructions": torch.backends.cpu.get_cpu_capability() if hasattr(torch.backends, "cpu") else "not told",
        "threads": torch.get_num_threads(),
        "python": platform.python_version(),
        "seconds_a_step": (time.perf_counter() - start) / options.steps,
        "processor_seconds_a_step": (time.process_time() - computed) / options.steps,
        "loss": sum(losses) / len(losses),
    }
    print(json.dumps(result))


if __name__ == "__main__":
    main()
