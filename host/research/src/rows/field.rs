//! Experiments on the training-free field and on what a bound chooses from.

use super::*;

/// Experiments on the training-free field and on what a bound chooses from.
pub(super) fn of_the_field() -> Vec<Row> {
    let made = |group: &str, scenes: &[&str], protocol: &str| -> String {
        scenes.iter().map(|scene| format!(" {group}=made:{scene}={protocol}")).collect()
    };
    let rooms = made(
        "rooms",
        &["room/arc/101", "room/forward/102", "room/handheld/103", "room/turntable/104"],
        "nearest:3:2,6",
    );
    let gardens = made("gardens", &["garden/arc/115", "garden/forward/116", "garden/handheld/117"], "nearest:3:2,6");
    let objects: String = KINDS
        .iter()
        .map(|kind| {
            let scenes = [0, 1, 2].map(|index| format!("{kind}/{index}"));
            made(&format!("{kind},random"), &scenes.each_ref().map(String::as_str), "random:sources=3")
        })
        .collect();
    let close = made("cars,close", &["cars/0", "cars/1", "cars/2"], "close");
    let mesh: String = ["baja-bug", "car1-trb1", "car4-trb1", "p406"]
        .iter()
        .map(|car| format!(" mesh,random={{DATA}}/torcs_cars/{car}=random:sources=3"))
        .collect();
    let photographs: String = [
        "fern=llff:3",
        "dtu_scan65=dtu:3",
        "fox=nearest:4:0012,0045",
        "herz_jesus_p8=nearest:4:2,5",
        "cup=nearest:4:25,50",
        "dino=nearest:4",
    ]
    .iter()
    .map(|job| format!(" {}={{DATA}}/{job}", job.split('=').next().unwrap_or_default()))
    .collect();
    let generated: String = rooms.replace("rooms=", "generated=")
        + &gardens.replace("gardens=", "generated=")
        + &made("generated", &["garden/turntable/118"], "nearest:3:2,6");
    let tested: String =
        ["fern=llff:3", "fox=nearest:4", "herz_jesus_p8=nearest:4", "cup=nearest:4", "dtu_scan65=dtu:3"]
            .iter()
            .map(|job| format!(" photographs={{DATA}}/{job}"))
            .collect();
    let at = |jobs: &[&str]| -> String { jobs.iter().map(|job| format!(" {{DATA}}/{job}")).collect() };
    let selections: String = [
        "fern=llff:3",
        "fern=llff:6",
        "fox=nearest:4",
        "fox=nearest:10",
        "herz_jesus_p8=nearest:4",
        "cup=llff:9",
        "cup=nearest:4",
        "dtu_scan65=dtu:3",
        "dino=nearest:4",
    ]
    .iter()
    .map(|job| format!(" {{DATA}}/{job}"))
    .collect();
    vec![
        row(
            "headroom",
            "what better depths, visibility or blending could gain",
            &["headroom.txt"],
            Hours::Estimated(0.5),
            vec![print(format!("viewfuse-research headroom 128 2{rooms}{gardens}{objects}{close}{mesh}{photographs}"))],
        )
        .needs(&PHOTOGRAPHS)
        .needs(&[MESH])
        .also(&[
            "host/research/src/experiments/headroom",
            "host/research/src/experiments/planes",
            "host/synthetic/src",
        ]),
        row(
            "refinement",
            "what a learned refinement gains over the field",
            &["refinement.txt"],
            Hours::Estimated(8.0),
            vec![print(format!("viewfuse-research refinement 96 250 16{generated}{tested}"))],
        )
        .needs(&PHOTOGRAPHS[..5])
        .also(&[
            "host/research/src/experiments/refinement",
            "host/research/src/experiments/planes",
            "host/synthetic/src",
        ]),
        row(
            "mixture",
            "what mixing the training-free picture with a network's gains",
            &["mixture.txt"],
            Hours::Estimated(0.2),
            vec![
                work(format!("{TWENTY} cars {{WORK}}/twenty")),
                print(format!("viewfuse-research mixture {PIXELNERF} random 64 {{WORK}}/twenty/cars_test/*")),
            ],
        )
        .also(&["host/models", "host/research/src/experiments/mixture.rs"]),
        row(
            "self_knowledge",
            "the choice of auto beside the best in hindsight, and the scores that it expects",
            &["self_knowledge.txt"],
            Hours::Estimated(2.0),
            vec![print(format!("viewfuse-research self_knowledge 128 4 grid{selections}"))],
        )
        .needs(&PHOTOGRAPHS)
        .also(&["host/research/src/experiments/self_knowledge"]),
        row(
            "efforts",
            "error and work of each effort that a bound chooses from",
            &["efforts.txt"],
            Hours::Estimated(0.5),
            vec![
                print("viewfuse-research efforts tests/data/room all/2 1,5"),
                print("viewfuse-research efforts {DATA}/herz_jesus_p8 all/2 1,5"),
                print("viewfuse-research efforts tests/data/toy 0..19 20,21"),
                print(format!("viewfuse-research efforts tests/data/car 16,72,136 48,104 {PIXELNERF}")),
                print(format!("viewfuse-research efforts tests/data/car 16,72,136 48,104 {GENVS}")),
            ],
        )
        .needs(&[HERZ])
        .also(&["host/models", "host/research/src/experiments/efforts.rs"]),
        row(
            "sweep_time",
            "run time of the plane sweep over planes, pixels and sources",
            &["sweep_time.txt"],
            Hours::Estimated(0.02),
            vec![print("viewfuse-research sweep_time tests/data/room")],
        )
        .also(&["host/research/src/experiments/sweep_time.rs"]),
        row(
            "gaussian_recipe",
            "Gaussians: what matters in the recipe",
            &["gaussian_recipe.txt"],
            Hours::Estimated(0.15),
            vec![print(format!(
                "viewfuse-research gaussian_recipe 200 3{}",
                at(&["kangaroo=llff:9", "fern=llff:3", "cup=llff:9", "gold_cape=llff:9"])
            ))],
        )
        .needs(&[KANGAROO, FERN, CUP, CAPE])
        .also(&["host/research/src/experiments/gaussians"]),
        row(
            "gaussian_weights",
            "Gaussians: the paper's question, weights of the sources in the loss",
            &["gaussian_weights.txt"],
            Hours::Estimated(0.1),
            vec![print(format!(
                "viewfuse-research gaussian_weights 200 5 60{}",
                at(&["kangaroo=llff:9", "cup=llff:9", "fern=llff:3", "herz_jesus_p8=fixed:0,1,3,4,6,7:2,5"])
            ))],
        )
        .needs(&[KANGAROO, CUP, FERN, HERZ])
        .also(&["host/research/src/experiments/gaussians"]),
        row(
            "gaussian_frames",
            "Gaussians: time of a picture by its stages",
            &["gaussian_frames.txt"],
            Hours::Estimated(0.01),
            vec![
                work("viewfuse optimise {DATA}/cup --size 400x300 --sources all/9 --count 40000 -o {WORK}/cup.ply"),
                print("viewfuse-research gaussian_frames {DATA}/cup {WORK}/cup.ply 40 320x240 504x378"),
            ],
        )
        .needs(&[CUP])
        .also(&["host/research/src/experiments/gaussians"]),
        row(
            "points",
            "the point cloud of an object",
            &["points.txt"],
            Hours::Estimated(0.01),
            vec![print("viewfuse points {DATA}/dino --size 320x240 -o {WORK}/dino.ply")],
        )
        .needs(&[DINO]),
    ]
}
