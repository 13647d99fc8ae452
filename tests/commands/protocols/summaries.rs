//! Tables over scenes, against sums by hand.

use std::time::Duration;
use viewfuse::evaluate::baseline::Baseline;
use viewfuse::evaluate::metrics::masked::PSNR_MASKED;
use viewfuse::evaluate::run_folder::Finished;
use viewfuse::evaluate::summary::{Standing, Table, Unit, tables};
use viewfuse::evaluate::{PSNR, SSIM, Score};

viewfuse_tests::trials![
    scenes_count_the_same_and_differences_are_paired,
    a_table_for_each_number_of_sources,
    equal_pictures_are_best,
    views_of_one_scene_take_the_place_of_scenes,
    nothing_leads_within_the_interval,
    words_say_what_is_below_a_baseline,
    masked_metrics_come_first,
];

const NEAREST_COPY: &str = Baseline::NearestCopy.name();

/// A job of a scene: PSNR and SSIM of the copy, the mean and another scheme.
fn job(number: usize, scene: usize, source_count: usize, values: [[f64; 2]; 3]) -> Finished {
    let score = |(scheme, [psnr, ssim]): (&str, [f64; 2])| Score {
        scheme: scheme.to_owned(),
        target: number.to_string(),
        source_count,
        values: vec![(PSNR.to_owned(), psnr), (SSIM.to_owned(), ssim)],
        time: Duration::from_secs(number as u64),
    };
    let scores = [NEAREST_COPY, "mean", "other"].into_iter().zip(values).map(score).collect();
    let sources = (0..source_count).map(|view| view.to_string()).collect();
    let (scene_name, device) = (format!("scene {scene}"), "cpu".to_owned());
    Finished { job: number, scene, scene_name, trial: 0, device, settings: String::new(), sources, scores }
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

/// A job of one scene with several targets: PSNR of the copy, the mean and another scheme.
fn views(values: &[[f64; 3]]) -> Finished {
    let mut whole = job(0, 0, 3, [[0.0; 2]; 3]);
    whole.scores.clear();
    for (target, values) in values.iter().enumerate() {
        let of_target = job(0, 0, 3, values.map(|psnr| [psnr, 0.5])).scores;
        whole.scores.extend(of_target.into_iter().map(|score| Score { target: target.to_string(), ..score }));
    }
    whole
}

fn leading(table: &Table) -> Vec<&str> {
    let leads = |row: &&viewfuse::evaluate::summary::Row| row.cells[0].as_ref().is_some_and(|cell| cell.leads);
    table.rows.iter().filter(leads).map(|row| row.scheme.as_str()).collect()
}

fn views_of_one_scene_take_the_place_of_scenes() {
    let once = views(&[[10.0, 20.0, 22.0], [12.0, 30.0, 33.0], [14.0, 10.0, 14.0]]);
    // A view that is drawn again is no other view: it makes no interval narrower.
    let again = [once.clone(), Finished { job: 1, ..once.clone() }, Finished { job: 2, ..once.clone() }];
    let (repeated, single) = (&tables(&again, false)[0], &tables(std::slice::from_ref(&once), false)[0]);
    assert_eq!((repeated.target_count, repeated.view_count, single.view_count), (9, 3, 3));
    assert_eq!(repeated.rows[2].cells, single.rows[2].cells);
    assert!(repeated.interval_words().contains("over 3 views of one scene"), "{}", repeated.interval_words());
    let jobs = [once];
    let table = &tables(&jobs, false)[0];
    assert_eq!((table.unit, table.scene_count, table.target_count), (Unit::Views, 1, 3));
    let cell = table.rows[2].cells[0].as_ref().expect("a cell");
    // Views 22, 33 and 14; differences 2, 3 and 4 with a standard deviation of 1.
    assert_eq!((cell.value.mean, cell.value.count), (23.0, 3));
    let versus = cell.versus_reference.expect("a difference");
    assert!((versus.half_width.expect("an interval") - 4.302_653 / 3.0_f64.sqrt()).abs() < 1.0e-5, "{versus:?}");
    assert!(table.interval_words().contains("over 3 views of one scene; they say nothing about other scenes"));
    // A second scene, and scenes are counted.
    let two = [jobs[0].clone(), job(1, 1, 3, [[10.0, 0.5]; 3])];
    let table = &tables(&two, false)[0];
    assert_eq!((table.unit, table.rows[2].cells[0].as_ref().map(|cell| cell.value.count)), (Unit::Scenes, Some(2)));
}

fn nothing_leads_within_the_interval() {
    // The other scheme is clearly best.
    let clear = tables(&[views(&[[10.0, 20.0, 22.0], [18.0, 30.0, 33.0], [4.0, 10.0, 14.0]])], false);
    assert_eq!(leading(&clear[0]), ["other"]);
    // Both schemes are above the copy; which of them is better, three views do not tell.
    let close = tables(&[views(&[[10.0, 20.0, 21.0], [10.5, 30.0, 29.0], [11.0, 25.0, 25.5]])], false);
    assert_eq!(leading(&close[0]), ["mean", "other"]);
    // Nor do they tell anything here, nor does a single view.
    let noise = tables(&[views(&[[10.0, 20.0, 15.0], [20.0, 10.0, 15.0]])], false);
    assert!(leading(&noise[0]).is_empty(), "{:?}", noise[0]);
    let single = tables(&[views(&[[10.0, 20.0, 30.0]])], false);
    assert!(leading(&single[0]).is_empty() && single[0].interval_words().contains("no intervals"));
}

fn words_say_what_is_below_a_baseline() {
    let table = &tables(&[views(&[[20.0, 15.0, 20.5], [21.0, 16.5, 20.0], [22.0, 17.0, 23.0]])], false)[0];
    let standing: Vec<Standing> = table.comparisons.iter().map(|comparison| comparison.standing).collect();
    assert_eq!(standing, [Standing::Below, Standing::NotBelow]);
    let words = table.verdicts();
    assert_eq!(words.len(), 2, "{words:?}");
    assert_eq!(words, ["mean: below the nearest copy", "other: not shown to differ from the nearest copy"]);
    let details = table.details();
    assert!(details[0].starts_with("mean: below the nearest copy (-4.83 ± 0.72 dB)"), "{details:?}");
    assert!(details[1].starts_with("other: not shown to differ from the nearest copy (+0.17 "), "{details:?}");
    let worse = &tables(&[views(&[[20.0, 19.5, 30.0], [20.0, 20.3, 31.0], [20.0, 19.9, 32.0]])], false)[0];
    assert!(worse.details()[0].starts_with("mean: not shown to differ from the nearest copy (-0.10 "));
    assert_eq!(worse.verdicts(), ["mean: not shown to differ from the nearest copy"]);
    let good = &tables(&[views(&[[20.0, 29.5, 30.0], [20.0, 30.3, 31.0]])], false)[0];
    assert_eq!(good.verdicts(), ["every scheme is above every baseline in PSNR beyond the interval"]);
    let single = &tables(&[views(&[[20.0, 19.5, 30.0]])], false)[0];
    assert_eq!(
        single.details(),
        [
            "mean: not shown to differ from the nearest copy (-0.50 dB, no interval)",
            "other: not shown to differ from the nearest copy (+10.00 dB, no interval)"
        ]
    );
    // A line about a scheme stays one, however long its name is.
    let mut long = views(&[[20.0, 15.0, 20.5], [21.0, 16.5, 20.0], [22.0, 17.0, 23.0]]);
    let name = format!("attention:{}/ends.safetensors", "a/long/path".repeat(20));
    long.scores.iter_mut().filter(|score| score.scheme == "mean").for_each(|score| score.scheme.clone_from(&name));
    let lines = tables(&[long], false)[0].verdicts();
    assert_eq!(lines.len(), 2);
    assert!(lines.iter().all(|line| line.chars().count() <= 100), "{lines:#?}");
    assert!(lines.iter().any(|line| line.contains("ends.safetensors: below the nearest copy")), "{lines:#?}");
}

fn masked_metrics_come_first() {
    let mut job = views(&[[20.0, 10.0, 30.0], [20.0, 11.0, 30.5]]);
    for score in &mut job.scores {
        let masked = if score.scheme == "mean" { 25.0 } else { 22.0 };
        score.values.push((PSNR_MASKED.to_owned(), masked));
    }
    let table = &tables(&[job], false)[0];
    let headings: Vec<String> = table.metrics.iter().map(|metric| metric.heading()).collect();
    assert_eq!(headings, ["PSNR full dB", "SSIM full", "PSNR masked dB"]);
    assert_eq!(table.headline, 2);
    // By the masked metric the mean is above the copy, although the full one says otherwise.
    assert_eq!(table.comparisons[0].standing, Standing::Above);
}
