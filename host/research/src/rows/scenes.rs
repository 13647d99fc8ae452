//! Tables of `evaluate`: by formulas, and of networks.

use super::question::{question, trained_with_weights};
use super::*;

/// Tables of `evaluate` by formulas.
pub(super) fn of_scenes() -> Vec<Row> {
    let photographs = [
        "fern --protocol llff:3 --size 504x378",
        "fern --protocol llff:3 --size 252x189",
        "fox --protocol nearest:4 --targets all/4 --size 270x480",
        "fox --protocol nearest:10 --targets all/4 --size 270x480",
        "cup --protocol llff:9 --size 400x300",
        "herz_jesus_p8 --protocol nearest:4 --targets 2,5 --size 384x256",
    ];
    let schemes = weights(&["auto", "error:alpha=1", "distance:power=2"]);
    let mut steps: Vec<Step> =
        photographs.iter().map(|scene| print(format!("viewfuse evaluate {{DATA}}/{scene}{schemes}"))).collect();
    steps.push(print(format!("viewfuse evaluate {{DATA}}/dtu_scan65 --protocol dtu:3 --size 400x300{schemes}")));
    steps.push(print(format!(
        "viewfuse evaluate {{DATA}}/dtu_scan65 --protocol dtu:3,masks=given --size 400x300{schemes}"
    )));
    vec![
        row(
            "toy",
            "all schemes on the sample scene",
            &["toy.txt"],
            Hours::Estimated(0.01),
            vec![print("viewfuse evaluate tests/data/toy --targets 20..23 --sources 0..19 --device cpu")],
        )
        .also(&["tests/data/toy"]),
        row(
            "dino",
            "all schemes on photographs of an object",
            &["dino.txt"],
            Hours::Estimated(0.05),
            vec![print("viewfuse evaluate {DATA}/dino --targets 1,4,7,10,13,16 --size 160x120 --device cpu")],
        )
        .needs(&[DINO]),
        row("photographs", "scenes with backgrounds", &["photographs.txt"], Hours::Estimated(1.0), steps)
            .needs(&[FERN, FOX, CUP, HERZ, DTU]),
        row(
            "mesh_cars",
            "the training-free field on path-traced cars, every third view a source",
            &["mesh_cars.txt"],
            Hours::Estimated(0.3),
            vec![print("viewfuse evaluate {DATA}/torcs_cars/* --sources all/3")],
        )
        .needs(&[MESH]),
        row(
            "poses",
            "poses of bare photographs beside the known ones",
            &["poses.txt"],
            Hours::Estimated(0.4),
            appended("poses viewfuse-openmvg 3,5,8", &of_posed(), "poses.txt"),
        )
        .needs(&[FERN, DINO, CUP, CAPE, KANGAROO, DTU, HERZ, FOX, MESH, Need::Program("viewfuse-openmvg")])
        .also(&["host/pose/src", "host/pose/openmvg/src", "tests/data/room", "tests/data/toy"]),
        row(
            "poses_pycolmap",
            "the same by pycolmap, where features are few",
            &["poses_pycolmap.txt"],
            Hours::Estimated(0.5),
            appended("poses pycolmap={PYTHON} 5,8", &of_few_features(), "poses_pycolmap.txt"),
        )
        .needs(&[DINO, CAPE, MESH, Need::Python("pycolmap")])
        .also(&["host/pose/src", "tests/data/toy"]),
        row(
            "posed_pictures",
            "what pictures lose by poses that were found",
            &["posed_pictures.txt"],
            Hours::Estimated(0.5),
            appended("posed_pictures viewfuse-openmvg", &of_textured(), "posed_pictures.txt"),
        )
        .needs(&[FERN, CUP, DTU, HERZ, FOX, Need::Program("viewfuse-openmvg")])
        .also(&["host/pose/src", "host/pose/openmvg/src"]),
        row(
            "refined_poses",
            "what refining poses by the photographs gains",
            &["refined_poses.txt"],
            Hours::Estimated(0.2),
            vec![print(format!("viewfuse-research refined_poses viewfuse-openmvg{} {{DATA}}/kangaroo", of_textured()))],
        )
        .needs(&[FERN, CUP, DTU, HERZ, FOX, KANGAROO, Need::Program("viewfuse-openmvg")])
        .also(&["host/pose/src", "host/pose/openmvg/src"]),
    ]
}

/// Steps of a program that appends rows to a file, which stands behind the program's name, and goes on with what is there.
fn appended(program: &str, scenes: &str, file: &'static str) -> Vec<Step> {
    let (name, arguments) = program.split_once(' ').unwrap_or((program, ""));
    let at = format!("{{WORK}}/{file}");
    vec![work(format!("viewfuse-research {name} {at} {arguments}{scenes}")), Step::Keep(at, file)]
}

/// The scenes whose photographs have few features.
fn of_few_features() -> String {
    " {DATA}/dino {DATA}/gold_cape tests/data/toy {DATA}/torcs_cars/baja-bug".to_owned()
}

/// The textured scenes.
fn of_textured() -> String {
    ["fern", "herz_jesus_p8", "fox", "cup", "dtu_scan65"].map(|scene| format!(" {{DATA}}/{scene}")).concat()
}

/// The scenes whose poses are removed.
fn of_posed() -> String {
    let given = ["fern", "dino", "cup", "gold_cape", "kangaroo"].map(|scene| format!(" {{DATA}}/{scene}"));
    let large = ["dtu_scan65", "herz_jesus_p8", "fox", "torcs_cars/baja-bug", "torcs_cars/p406"]
        .map(|scene| format!(" {{DATA}}/{scene}"));
    [given.concat(), " tests/data/room tests/data/toy".to_owned(), large.concat()].concat()
}

/// A table of a network on the twelve cars.
fn on_twelve(protocol: &str, options: &str, network: &str) -> Step {
    let schemes = attentions(network);
    print(format!(
        "viewfuse evaluate {{WORK}}/twelve/cars --split test {protocol} --model {network} {options}{schemes}"
    ))
}

/// Networks with the options that they are rendered with.
const NETWORKS: [(&str, &str); 2] = [(PIXELNERF, "--max-error 40dB"), (GENVS, "--steps 1")];

/// Tables of networks and of the paper's question.
pub(super) fn of_networks() -> Vec<Row> {
    const BOUND: &str = "--max-error 40dB";
    let pixelnerf = |name, what, files, hours, protocol: &str| {
        row(name, what, files, Hours::Estimated(hours), vec![work(TWELVE), on_twelve(protocol, BOUND, PIXELNERF)])
            .also(&["host/models"])
    };
    let on_mesh = |options: &str, network: &str| {
        let schemes = attentions(network);
        print(format!("viewfuse evaluate {{DATA}}/torcs_cars/* {options} --size 64x64 --model {network}{schemes}"))
    };
    let mut genvs = vec![work(TWELVE)];
    for protocol in ["random", "close", "count"] {
        genvs.push(on_twelve(&format!("--protocol {protocol} --targets-per-trial 4"), "--steps 1", GENVS));
    }
    genvs.push(on_mesh("--protocol random --trials 2 --targets-per-trial 4 --steps 1", GENVS));
    vec![
        pixelnerf(
            "random_generated_cars",
            "PixelNeRF, three random sources",
            &["random_generated_cars.txt"],
            0.05,
            "--protocol random --targets-per-trial 4",
        ),
        pixelnerf(
            "close_generated_cars",
            "PixelNeRF, five sources, one close",
            &["close_generated_cars.txt"],
            0.05,
            "--protocol close --targets-per-trial 4",
        ),
        pixelnerf(
            "count_generated_cars",
            "PixelNeRF, 2 to 32 sources",
            &["count_generated_cars.txt"],
            0.3,
            "--protocol count --targets-per-trial 2",
        ),
        row(
            "random_mesh_cars",
            "PixelNeRF on path-traced cars, three random sources",
            &["random_mesh_cars.txt"],
            Hours::Estimated(0.05),
            vec![on_mesh("--protocol random --trials 2 --targets-per-trial 4 --max-error 40dB", PIXELNERF)],
        )
        .needs(&[MESH])
        .also(&["host/models"]),
        row(
            "count_mesh_cars",
            "PixelNeRF on path-traced cars, 2 to 16 sources",
            &["count_mesh_cars.txt"],
            Hours::Estimated(0.1),
            vec![on_mesh("--protocol count:sources=2+8+16 --targets-per-trial 4 --max-error 40dB", PIXELNERF)],
        )
        .needs(&[MESH])
        .also(&["host/models"]),
        row("genvs", "GeNVS on generated and path-traced cars", &["genvs.txt"], Hours::Estimated(1.0), genvs)
            .needs(&[MESH])
            .also(&["host/models"]),
        question(
            "paper_question",
            "what weighting gains over the mean on the training-free field",
            &["paper_question.txt", "paper_question.svg"],
            Hours::Estimated(4.0),
            &[("", "")],
            &["generated objects", "mesh cars", "photographs"],
        )
        .needs(&PHOTOGRAPHS)
        .needs(&[MESH]),
        question(
            "paper_question_networks",
            "the same on both networks, generated objects",
            &["paper_question_networks.txt", "paper_question_networks.svg"],
            Hours::Estimated(12.0),
            &NETWORKS,
            &["generated objects"],
        )
        .also(&["host/models"]),
        question(
            "paper_question_mesh_cars",
            "the same on both networks, path-traced cars",
            &["paper_question_mesh_cars.txt"],
            Hours::Estimated(2.0),
            &NETWORKS,
            &["mesh cars"],
        )
        .needs(&[MESH])
        .also(&["host/models"]),
        trained_with_weights(),
    ]
}
