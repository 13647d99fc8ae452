//! Some of the results, small: in minutes, with the scenes of `tests/data` and a few generated ones. They show that every
//! program runs; their numbers are of no use.

use super::*;

/// Two cars of 24 views.
const CARS: &str =
    "viewfuse scenes make cars {WORK}/cars --train 0 --val 0 --test 2 --test-views 24 --size 64 --seed 1";

/// A result with a name and files of the whole list.
fn quick(name: &'static str, files: &'static [&'static str], steps: Vec<Step>) -> Row {
    row(name, "small", files, Hours::Estimated(0.01), steps)
}

pub(super) fn rows() -> Vec<Row> {
    let evaluated = |protocol: &str| {
        work(format!(
            "viewfuse evaluate {{WORK}}/cars/cars --split test --protocol {protocol} --targets-per-trial 1 --size 32x32 \
             --weights mean --weights error:alpha=1 -o {{WORK}}/{protocol}"
        ))
    };
    let folders = ["random", "close"].map(|protocol| format!(" cars:cars={{WORK}}/{protocol}")).concat();
    vec![
        quick(
            "toy",
            &["toy.txt"],
            vec![print("viewfuse evaluate tests/data/toy --targets 20..23 --sources 0..19 --device cpu")],
        ),
        quick("cpu", &["cpu.txt"], vec![print("viewfuse check --device cpu --seeds 1")]),
        quick("rates", &["rates.txt"], vec![print("viewfuse bench --device cpu --rounds 1")]),
        quick(
            "random_generated_cars",
            &["random_generated_cars.txt"],
            vec![
                work(CARS),
                print(format!(
                    "viewfuse evaluate {{WORK}}/cars/cars --split test --protocol random --targets-per-trial 1 \
                     --model {PIXELNERF} --max-error 40dB{}",
                    attentions(PIXELNERF)
                )),
            ],
        ),
        quick(
            "paper_question",
            &["paper_question.txt", "paper_question.svg"],
            vec![
                work(CARS),
                evaluated("random"),
                evaluated("close"),
                print(format!("viewfuse-research paper_question {{WORK}}/paper_question.svg{folders}")),
                Step::Keep("{WORK}/paper_question.svg".to_owned(), "paper_question.svg"),
            ],
        ),
        quick(
            "headroom",
            &["headroom.txt"],
            vec![print(
                "viewfuse-research headroom 48 1 rooms=made:room/arc/101=nearest:3:2 cars=made:cars/0=random:sources=3 \
                 room=tests/data/room=nearest:3",
            )],
        ),
        quick(
            "refinement",
            &["refinement.txt"],
            vec![print(
                "viewfuse-research refinement 32 4 2 generated=made:garden/arc/115=nearest:3:2 photographs=tests/data/room=nearest:3:4 photographs=made:room/arc/101=nearest:3:2",
            )],
        ),
        quick(
            "mixture",
            &["mixture.txt"],
            vec![
                work(CARS),
                print(format!("viewfuse-research mixture {PIXELNERF} random 32 {{WORK}}/cars/cars_test/*")),
            ],
        ),
        quick(
            "self_knowledge",
            &["self_knowledge.txt"],
            vec![print(
                "viewfuse-research self_knowledge 48 1 chosen tests/data/room=nearest:4 tests/data/room=llff:3",
            )],
        ),
        quick(
            "efforts",
            &["efforts.txt"],
            vec![
                Step::Once(
                    "{WORK}/room",
                    "viewfuse scenes photograph room {WORK}/room --rig forward --views 6 --size 64x48 --seed 7",
                ),
                print("viewfuse-research efforts {WORK}/room 0,1,3,4 2"),
            ],
        ),
        quick(
            "gaussian_recipe",
            &["gaussian_recipe.txt"],
            vec![print("viewfuse-research gaussian_recipe 48 1 tests/data/room=llff:4")],
        ),
        quick(
            "gaussian_weights",
            &["gaussian_weights.txt"],
            vec![print("viewfuse-research gaussian_weights 48 2 12 tests/data/room=llff:4")],
        ),
        quick(
            "gaussian_frames",
            &["gaussian_frames.txt"],
            vec![
                work("viewfuse optimise tests/data/room --size 64x48 --iterations 8 -o {WORK}/room.ply"),
                print("viewfuse-research gaussian_frames tests/data/room {WORK}/room.ply 3 64x48"),
            ],
        ),
        quick("sweep_time", &["sweep_time.txt"], vec![print("viewfuse-research sweep_time tests/data/room")]),
        quick(
            "pareto_training_free",
            &["pareto_training_free.svg"],
            vec![
                work(
                    "viewfuse pareto tests/data/room --targets 5 --size 64x48 --device cpu --repeat 1 --only all -o {WORK}/pareto",
                ),
                Step::Keep("{WORK}/pareto/pareto.svg".to_owned(), "pareto_training_free.svg"),
            ],
        ),
    ]
}
