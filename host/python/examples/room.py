"""A view of the sample room from its other photographs: python room.py tests/data/room view.png"""

import sys

import numpy as np

import viewfuse

folder, picture = sys.argv[1:]

# Poses and headers are read; photographs are decoded when they are needed.
scene = viewfuse.open(folder)
print(scene)
print("first view:", scene.names[0], "size", scene.sizes[0], "centre", scene.poses[0, :3, 3].round(3))

# Which photographs count for view 5, under two schemes.
weights = scene.weights(["error:alpha=1", "mean"], targets="5")
for scheme, values in zip(weights.schemes, weights.values[:, 0]):
    order = np.argsort(-values)[:3]
    print(f"{scheme}:", ", ".join(f"{weights.sources[source]} {values[source]:.3f}" for source in order))

# View 5 from all others, at half the size.
(frame,) = scene.render("error:alpha=1", targets="5", size=(160, 120))
print(frame)
print("colours", frame.colours.shape, frame.colours.dtype, "picture", frame.picture.shape, frame.picture.dtype)
near, far = np.quantile(frame.depths[frame.depths > 0], [0.01, 0.99])
print(f"depths from {near:.2f} to {far:.2f}; mean confidence {frame.confidences.mean():.2f}")

# The score again, from the arrays, and that of the photograph that counts most.
print(f"PSNR {viewfuse.psnr(frame.picture, frame.truth):.2f} dB, SSIM {viewfuse.ssim(frame.picture, frame.truth):.3f}")
nearest = scene.photograph(frame.sources[frame.weights.argmax()])[..., :3]
copy = nearest.reshape(120, 2, 160, 2, 3).mean(axis=(1, 3)).round().astype(np.uint8)
print(f"a copy of the nearest photograph: {viewfuse.psnr(copy, frame.truth):.2f} dB")

# A camera of one's own: half a step to the right of view 5.
pose = frame.pose.copy()
pose[:3, 3] += 0.05 * pose[:3, 0]
(beside,) = scene.render("error:alpha=1", poses=pose[None], size=(160, 120))
print("mean change of a pixel:", np.abs(beside.colours - frame.colours)[..., :3].mean().round(4))

frame.save(picture)
