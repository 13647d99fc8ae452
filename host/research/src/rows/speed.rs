//! Error against run time, times beside others, and what tests print.

use super::*;

/// Error against run time, and times beside others.
pub(super) fn of_speed() -> Vec<Row> {
    let car = format!("tests/data/car --sources 16,72,136 --targets 48 --model {PIXELNERF}");
    let curve = |name, what, file: &'static [&'static str], line: String| {
        let folder = format!("{{WORK}}/{name}");
        let steps = vec![work(format!("{line} -o {folder}")), Step::Keep(format!("{folder}/pareto.svg"), file[0])];
        row(name, what, file, Hours::Estimated(0.1), steps).also(&["host/models"])
    };
    let once = "--device cpu --repeat 1 --only all";
    vec![
        row(
            "pareto_car",
            "PixelNeRF: error against run time of each omission",
            &["pareto_car.txt"],
            Hours::Estimated(0.2),
            vec![print(format!("viewfuse pareto {car} --device cpu -o {{WORK}}/pareto_car"))],
        )
        .also(&["host/models"]),
        curve(
            "pareto_pixelnerf",
            "PixelNeRF: curves of settings and bounds",
            &["pareto_pixelnerf.svg"],
            format!("viewfuse pareto {car} --size 64x64 --weights mean {once} --only \"at most\" --beside \"PyTorch 2.15=5.35\""),
        ),
        curve(
            "pareto_genvs",
            "GeNVS of the published size: the same",
            &["pareto_genvs.svg"],
            format!(
                "viewfuse pareto tests/data/toy --sources 0,8,16 --targets 20 --size 128x128 --weights mean --model genvs \
                 --near-far 0.8,1.8 --background white {once} --only \"at most\" --only \"ipndm, \" --beside \"PyTorch 2.15=37.6\""
            ),
        ),
        curve(
            "pareto_training_free",
            "training-free: the same",
            &["pareto_training_free.svg"],
            format!("viewfuse pareto tests/data/room --targets 5 --size 256x192 {once} --only \"at most\" --only \"leave out\""),
        ),
        row(
            "pytorch",
            "networks beside PyTorch: pictures and steps of training",
            &["pytorch.txt"],
            Hours::Estimated(1.0),
            vec![
                work(TWELVE),
                print("tests/compare_pytorch --size 24 --repeat 3 --python {PYTHON}"),
                print(format!(
                    "tests/compare_pytorch --scene tests/data/car --model {PIXELNERF} --sources 2,9,17 --target 6 --size 64 \
                     --repeat 5 --python {{PYTHON}}"
                )),
                print(format!(
                    "tests/compare_pytorch --scene {{WORK}}/twelve/cars_test/* {{DATA}}/torcs_cars/* --model {PIXELNERF} \
                     --sources 2,9,17 --target 6 --size 64 --rays 512 --only max-error --python {{PYTHON}}"
                )),
                print("tests/compare_pytorch_genvs --python {PYTHON}"),
                print("tests/compare_pytorch_gaussians --repeat 3 --python {PYTHON}"),
                print("tests/compare_pytorch_training --threads 1 --steps 16 --repeat 2 --python {PYTHON}"),
            ],
        )
        .needs(&[PYTORCH, MESH])
        .also(&["host/models", "host/train/src", "tests/pytorch"]),
        row(
            "rates",
            "rates of kernels beside what the processor can do",
            &["rates.txt"],
            Hours::Estimated(0.05),
            vec![print("viewfuse bench --device cpu")],
        )
        .only(&["core/kernels/src", "host/device/src", "host/check/src"]),
        row(
            "speed",
            "repeated timing with its spread: weights, the fields",
            &["speed.txt"],
            Hours::Estimated(0.1),
            vec![print("cargo bench -p viewfuse-tests --bench speed")],
        ),
    ]
}

/// What tests and `check` print.
pub(super) fn of_tests() -> Vec<Row> {
    const KERNELS: [&str; 4] = ["core/src", "core/kernels/src", "host/device/src", "host/check/src"];
    let test = |binary: &str, filter: &str| {
        print(format!("cargo test --release -p viewfuse-tests --test {binary} {filter} -- --nocapture"))
    };
    let check = |name, what, files, device: &str| {
        row(name, what, files, Hours::Measured(0.004), vec![print(format!("viewfuse check --device {device}"))])
            .only(&KERNELS)
    };
    vec![
        check("cpu", "every kernel on the CPU beside its f64 evaluation", &["cpu.txt"], "cpu"),
        check("llvmpipe", "the same on Mesa's software driver", &["llvmpipe.txt"], "vulkan:llvmpipe")
            .needs(&[Need::Program("vulkaninfo")])
            .also(&["vulkan/src"]),
        row(
            "firmware",
            "instructions, stack and code on three microcontrollers",
            &["firmware.md"],
            Hours::Estimated(0.1),
            vec![work("VIEWFUSE_WRITE_TABLES=1 VIEWFUSE_REQUIRE_FIRMWARE=1 cargo test --release -p viewfuse-tests --test embedded"), Step::Keep("host/research/results/firmware.md".to_owned(), "firmware.md")],
        )
        .needs(&[Need::Program("qemu-system-arm"), Need::Program("qemu-system-riscv32")])
        .only(&["core/src", "tests/firmware/src", "tests/firmware/list/src"]),
        row(
            "quantised",
            "what 8 bits change of attention, and the bound on it",
            &["quantised.txt"],
            Hours::Estimated(0.01),
            vec![test("numerics", "quantised")],
        )
        .only(&["core/src", "host/weighting/src", "host/models", "tests/numerics"]),
        row(
            "samplers",
            "errors of the denoiser's samplers by number of calls",
            &["samplers.txt"],
            Hours::Estimated(0.05),
            vec![test("numerics", "sampler")],
        )
        .only(&["core/src", "tests/numerics"]),
        row(
            "scales",
            "weights and pictures of scenes at ten scales from 1e-9 to 1e9, of every scheme and field",
            &["scales.txt"],
            Hours::Estimated(0.3),
            vec![print("VIEWFUSE_ALL_SCALES=1 cargo test --release -p viewfuse-tests --test fields scales -- --nocapture --test-threads 1")],
        )
        .only(&["core/src", "host/scene/src", "host/weighting/src", "host/field/src", "host/models", "tests/fields"]),
        row(
            "bounds",
            "pictures under a bound: their error, and their time beside fixed efforts",
            &["bounds.txt"],
            Hours::Estimated(0.2),
            vec![test("fields", "budget")],
        )
        .also(&["tests/fields"]),
    ]
}
