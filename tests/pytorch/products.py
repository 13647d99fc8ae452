#!/usr/bin/env python3
"""Single products in PyTorch, at the sizes of `viewfuse bench`: linear layers and 3x3 convolutions in f32, in tf32 and in f16.

    products.py --device cuda              # the median of five rounds
    products.py --device cpu --rounds 1    # f32 and small sizes alone

Operands of f32 and tf32 are 32 bits in memory, those of f16 are 16. Errors are the largest difference from f64 over the
largest value. Needs torch.
"""

import argparse
import statistics
import time

import torch
import torch.nn.functional as F

LINEARS = [(2046, 512, 512), (16384, 64, 64), (32768, 512, 512)]
CONVOLUTIONS = [(64, 64), (128, 128), (32, 256), (16, 512)]
# A round takes about so long.
SECONDS = 0.05


def seconds(run, on_gpu):
    """The time of a call, of several behind each other."""

    def timed(count):
        if on_gpu:
            torch.cuda.synchronize()
        start = time.perf_counter()
        for _ in range(count):
            run()
        if on_gpu:
            torch.cuda.synchronize()
        return (time.perf_counter() - start) / count

    timed(2)
    return timed(max(1, min(1000, int(SECONDS / timed(1)))))


def linear(rows, inner, columns):
    inputs, weights = torch.rand(rows, inner) - 0.5, torch.rand(columns, inner) - 0.5
    return "linear", f"{rows}x{inner}x{columns}", 2 * rows * inner * columns, F.linear, inputs, weights, {}


def convolution(side, channels):
    inputs, weights = torch.rand(1, channels, side, side) - 0.5, torch.rand(channels, channels, 3, 3) - 0.5
    operations = 2 * side * side * channels * channels * 9
    return "convolution", f"{side}x{side}, {channels} channels, 3x3", operations, F.conv2d, inputs, weights, {"padding": 1}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", default="cpu", help="cpu, or cuda")
    parser.add_argument("--rounds", type=int, default=5)
    options = parser.parse_args()
    on_gpu = options.device != "cpu"
    torch.manual_seed(0)
    torch.backends.cudnn.benchmark = True
    works = [linear(*sizes) for sizes in (LINEARS if on_gpu else LINEARS[:2])]
    works += [convolution(*sizes) for sizes in (CONVOLUTIONS if on_gpu else CONVOLUTIONS[:1])]
    formats = [("f32", torch.float32, False), ("tf32", torch.float32, True), ("f16", torch.float16, False)]
    print(f"PyTorch {torch.__version__} on {torch.cuda.get_device_name() if on_gpu else 'cpu'}, medians of {options.rounds} rounds")
    print(f"{'product':12} {'size':30} {'factors':8} {'ms':>9} {'GFLOP/s':>10} {'error':>9}")
    for name, size, operations, function, inputs, weights, more in works:
        inputs, weights = inputs.to(options.device), weights.to(options.device)
        exact = function(inputs.double(), weights.double(), **more)
        for label, kind, tensor_float in formats if on_gpu else formats[:1]:
            torch.backends.cuda.matmul.allow_tf32 = torch.backends.cudnn.allow_tf32 = tensor_float
            given, factors = inputs.to(kind), weights.to(kind)
            if name == "convolution" and kind == torch.float16:
                given, factors = (tensor.to(memory_format=torch.channels_last) for tensor in (given, factors))
            times = [seconds(lambda: function(given, factors, **more), on_gpu) for _ in range(options.rounds)]
            error = ((function(given, factors, **more).double() - exact).abs().max() / exact.abs().max()).item()
            took = statistics.median(times)
            print(f"{name:12} {size:30} {label:8} {1000 * took:9.3f} {operations / took / 1e9:10.1f} {error:9.1e}")


if __name__ == "__main__":
    with torch.no_grad():
        main()
