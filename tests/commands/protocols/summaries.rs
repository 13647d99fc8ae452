//! Tables over scenes, against sums by hand.

use std::time::Duration;
use viewfuse::evaluate::run_folder::Finished;
use viewfuse::evaluate::summary::{Table, tables};
use viewfuse::evaluate::{NEAREST_COPY, PSNR, SSIM, Score};

viewfuse_tests::trials![
    scenes_count_the_same_and_differences_are_paired,
    a_table_for_each_number_of_sources,
    equal_pictures_are_best,
];

/// A job of a scene: PSNR and SSIM of the copy, the mean and another scheme.
fn job(number: usize, scene: usize, source_count: usize, values: [[f64; 2]; 3]) -> Finished {
    let score = |(scheme, [psnr, ssim]): (&str, [f64; 2])| Score {
        scheme: scheme.to_owned(),
        target: "1".to_owned(),
        source_count,
        values: vec![(PSNR.to_owned(), psnr), (SSIM.to_owned(), ssim)],
        time: Duration::from_secs(number as u64),
    };
    let scores = [NEAREST_COPY, "mean", "other"].into_iter().zip(values).map(score).collect();
    let sources = (0..source_count).map(|view| view.to_string()).collect();
    let (scene_name, device) = (format!("scene {scene}"), "cpu".to_owned());
    Finished { job: number, scene, scene_name, trial: 0, device, sources, scores }
}

fn value(table: &Table, row: usize, column: usize) -> f64 {
    table.rows[row].cells[column].as_ref().expect("a cell").value.mean
}

fn scenes_count_the_same_and_differences_are_paired() {
    // The first scene has two jobs, the others one: its mean comes first.
    let jobs = [
        job(0, 0, 3, [[10.0, 0.5], [20.0, 0.8], [22.0, 0.8004]]),
        job(1, 0, 3, [[12.0, 0.5], [24.0, 0.8], [26.0, 0.8004]]),
        job(2, 1, 3, [[11.0, 0.5], [32.0, 0.8], [35.0, 0.8004]]),
        job(3, 2, 3, [[11.0, 0.5], [12.0, 0.8], [16.0, 0.8004]]),
    ];
    let all = tables(&jobs, false);
    assert_eq!(all.len(), 1);
    let table = &all[0];
    assert_eq!((table.scene_count, table.target_count, table.source_counts.as_slice()), (3, 4, &[3][..]));
    assert_eq!(table.rows.iter().map(|row| row.scheme.as_str()).collect::<Vec<_>>(), [NEAREST_COPY, "mean", "other"]);
    assert_eq!([0, 1, 2].map(|row| value(table, row, 0)), [11.0, 22.0, 25.0]);
    // Means of scenes 22, 32, 12: a standard deviation of 10; differences 2, 3, 4: of 1. 4.302653 is the quantile.
    let interval = |row: usize, versus: bool| {
        let cell = table.rows[row].cells[0].as_ref().expect("a cell");
        if versus { cell.versus_reference.expect("a difference") } else { cell.value }
    };
    let near = |value: Option<f64>, expected: f64| assert!((value.expect("an interval") - expected).abs() < 1.0e-5);
    near(interval(1, false).half_width, 4.302_653 * 10.0 / 3.0_f64.sqrt());
    assert_eq!(interval(2, true).mean, 3.0);
    near(interval(2, true).half_width, 4.302_653 / 3.0_f64.sqrt());
    assert_eq!(table.rows[1].cells[0].as_ref().expect("a cell").versus_reference, None);
    // Places are of what is written: 0.8 and 0.8004 look the same.
    let places = |column: usize| -> Vec<usize> {
        table.rows.iter().map(|row| row.cells[column].as_ref().expect("a cell").place).collect()
    };
    assert_eq!((places(0), places(1)), (vec![3, 2, 1], vec![2, 1, 1]));
    assert_eq!((table.rows[0].seconds, table.rows[1].seconds), (None, Some(1.5)));
}

fn a_table_for_each_number_of_sources() {
    let jobs = [job(0, 0, 8, [[10.0, 0.5]; 3]), job(1, 0, 2, [[9.0, 0.5]; 3]), job(2, 1, 8, [[11.0, 0.5]; 3])];
    let all = tables(&jobs, true);
    let counts: Vec<_> = all.iter().map(|table| (table.source_counts.clone(), table.scene_count)).collect();
    assert_eq!(counts, [(vec![2], 1), (vec![8], 2)]);
    assert_eq!(all[0].rows[0].cells[0].as_ref().expect("a cell").value.half_width, None);
    assert_eq!(tables(&jobs, false)[0].source_counts, [2, 8]);
}

fn equal_pictures_are_best() {
    let jobs = [job(0, 0, 3, [[10.0, 0.5], [f64::INFINITY, 1.0], [30.0, 0.9]])];
    let cell = tables(&jobs, false)[0].rows[1].cells[0].clone().expect("a cell");
    assert_eq!((cell.value.mean, cell.value.half_width, cell.place), (f64::INFINITY, None, 1));
    // Infinity goes through a journal and back.
    let text = serde_json::to_string(&jobs[0]).expect("JSON");
    assert_eq!(serde_json::from_str::<Finished>(&text).expect("a job"), jobs[0]);
}
