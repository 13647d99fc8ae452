#!/usr/bin/env python3
"""A snapshot as EDM's training writes it, in small: a network that Python's pickle wrote, classes with their source.

Writes snapshot.pkl and, read back from it by PyTorch itself, its state_dict as snapshot.safetensors. The files in
tests/data were made so; tests/checkpoints/snapshots.rs reads the one and compares with the other.

The mechanism is that of torch_utils/persistence.py of NVIDIA's projects: an object of a decorated class is pickled as a
call of `_reconstruct_persistent_obj` with a description that holds the source text of its module. The class names in
the file are those of the original; here they lead to this program.

Needs torch and safetensors. Example:

    snapshot.py tests/data/checkpoints
"""

import copy
import pickle
import sys
import types
from pathlib import Path

import torch
from safetensors.torch import save_file

SOURCE = "raise SystemExit('the source text in a snapshot was executed')\n"


# The mechanism, under the name that it has in real files


def reconstruct(description):
    made = CLASSES[description["class_name"]]
    new = made.__new__(made)
    new.__dict__.update(description["state"])
    return new


reconstruct.__name__ = reconstruct.__qualname__ = "_reconstruct_persistent_obj"
reconstruct.__module__ = "torch_utils.persistence"
persistence = types.ModuleType("torch_utils.persistence")
persistence._reconstruct_persistent_obj = reconstruct
sys.modules["torch_utils"] = types.ModuleType("torch_utils")
sys.modules["torch_utils.persistence"] = persistence


class Persistent:
    """What the decorator makes of a class."""

    def __reduce__(self):
        description = {
            "type": "class",
            "version": 6,
            "module_src": SOURCE,
            "class_name": type(self).__name__,
            "state": dict(self.__dict__),
        }
        return reconstruct, (description,), None


# Networks


class Resampler(Persistent, torch.nn.Module):
    def __init__(self, kernel):
        super().__init__()
        self.kernel = kernel
        self.weight = torch.nn.Parameter(torch.zeros(3, 2, kernel, kernel)) if kernel else None
        self.register_buffer("resample_filter", torch.zeros(1, 1, 2, 2))
        self.register_buffer("unused", None)


class Denoiser(Persistent, torch.nn.Module):
    def __init__(self):
        super().__init__()
        self.sigma_data = 0.5
        self.dec = torch.nn.ModuleDict({"4x4_up": Resampler(3), "4x4_aux": Resampler(0)})
        self.empty = None
        self.dropout = torch.nn.Dropout(0.13)


def identity(x):
    return x


class Network(torch.nn.Module):
    """As the whole network is: an ordinary module with persistent ones in it."""

    def __init__(self):
        super().__init__()
        self.encoder = torch.nn.Sequential(
            torch.nn.Conv2d(3, 2, 3, bias=False), torch.nn.BatchNorm2d(2), torch.nn.Identity(), torch.nn.Linear(2, 2)
        )
        # As layers are switched off, which leaves a function among the attributes.
        self.encoder[1].forward = identity
        self.denoiser = Denoiser()
        self.again = self.denoiser.dec["4x4_up"]
        self.tied = torch.nn.Linear(2, 2, bias=False)
        self.tied.weight = self.encoder[3].weight
        self.register_buffer("counter", torch.tensor(0))
        self.register_buffer("scratch", torch.ones(5), persistent=False)
        self.register_buffer("across", torch.zeros(3, 2).t())
        self.sixteen = torch.nn.Parameter(torch.zeros(3, dtype=torch.float16))


CLASSES = {"Resampler": Resampler, "Denoiser": Denoiser}


class Options(dict):
    """As the options of real files: a dict of a class of its own."""


def main():
    folder = Path(sys.argv[1])
    for made in [Network, Options, identity]:
        made.__module__ = "__main__"
    network = Network()
    with torch.no_grad():
        for number, (_, tensor) in enumerate(sorted(network.state_dict().items())):
            tensor.copy_((torch.arange(tensor.numel()).reshape(tensor.shape) / 8 - number).to(tensor.dtype))
    network = copy.deepcopy(network).eval().requires_grad_(False)
    data = {"ema": network, "loss_fn": Options(sigma_data=0.5), "augment_pipe": None, "dataset_kwargs": {"path": "x"}}
    (folder / "snapshot.pkl").write_bytes(pickle.dumps(data, protocol=4))
    read = pickle.loads((folder / "snapshot.pkl").read_bytes())["ema"].state_dict()
    save_file({name: tensor.clone().contiguous() for name, tensor in read.items()}, folder / "snapshot.safetensors")


if __name__ == "__main__":
    main()
