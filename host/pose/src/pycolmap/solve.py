"""COLMAP's steps on a folder of photographs, on one thread: features, exhaustive matching, incremental mapping.

The argument is a JSON file with `database`, `images`, `sparse`, `seed`, `max_side`, `dsp` and `cameras`, each with `images`,
`parameters` (SIMPLE_RADIAL's, or null) and `factor` (focal length in longest sides). Models are written to `sparse/0` and on.
"""

import json
import sys

try:
    import pycolmap
except ImportError as error:
    print(error)
    sys.exit(3)

with open(sys.argv[1], encoding="utf-8") as file:
    task = json.load(file)

pycolmap.set_random_seed(task["seed"])

extraction = pycolmap.FeatureExtractionOptions()
extraction.num_threads = 1
extraction.use_gpu = False
extraction.max_image_size = task["max_side"]
extraction.sift.estimate_affine_shape = task["dsp"]
extraction.sift.domain_size_pooling = task["dsp"]

for camera in task["cameras"]:
    reader = pycolmap.ImageReaderOptions()
    reader.camera_model = "SIMPLE_RADIAL"
    if camera["parameters"] is None:
        reader.default_focal_length_factor = camera["factor"]
    else:
        reader.camera_params = camera["parameters"]
    pycolmap.extract_features(
        task["database"],
        task["images"],
        image_names=camera["images"],
        camera_mode=pycolmap.CameraMode.SINGLE,
        reader_options=reader,
        extraction_options=extraction,
        device=pycolmap.Device.cpu,
    )

matching = pycolmap.FeatureMatchingOptions()
matching.num_threads = 1
matching.use_gpu = False
verification = pycolmap.TwoViewGeometryOptions()
verification.ransac.random_seed = task["seed"]
pycolmap.match_exhaustive(
    task["database"],
    matching_options=matching,
    verification_options=verification,
    device=pycolmap.Device.cpu,
)

mapping = pycolmap.IncrementalPipelineOptions()
mapping.num_threads = 1
mapping.random_seed = task["seed"]
mapping.min_model_size = 3
pycolmap.incremental_mapping(task["database"], task["images"], task["sparse"], mapping)

print("solved by COLMAP " + pycolmap.__version__, flush=True)
