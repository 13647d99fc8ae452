//! The networks and weightings that are in the repository, on an object that none of them was trained on.

use super::{done, list_of, number_of, read_json};
use serde_json::Value;
use std::collections::BTreeMap;
use viewfuse::evaluate::baseline::Baseline;
use viewfuse_tests::places::repository;
use viewfuse_tests::scenes::Folder;

viewfuse_tests::trials![
    networks_beat_the_nearest_copy_with_every_weighting,
    most_samples_are_omitted_and_the_picture_stays,
];

/// PSNR by scheme of some targets of the car, from three sources.
fn scores(network: &str, weightings: &[&str]) -> BTreeMap<String, f64> {
    let folder = Folder::new();
    let schemes: String = weightings.iter().map(|scheme| format!(" --weights {scheme}")).collect();
    let table = folder.join("scores.csv");
    done(
        &repository(),
        &format!(
            "evaluate tests/data/car --sources 16,72,136 --targets 48,160 --device cpu {network} \
             --weights mean{schemes} -o {}",
            table.display()
        ),
    );
    let mut reader = csv::Reader::from_path(&table).expect("a table");
    let header = reader.headers().expect("a header").clone();
    let column = |name: &str| header.iter().position(|title| title == name).unwrap_or_else(|| panic!("{header:?}"));
    let (scheme, psnr) = (column("scheme"), column("psnr_db"));
    let mut sums: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    for row in reader.records() {
        let row = row.expect("a row");
        sums.entry(row[scheme].to_owned()).or_default().push(row[psnr].parse().expect("a number"));
    }
    sums.into_iter().map(|(scheme, all)| (scheme, all.iter().sum::<f64>() / all.len() as f64)).collect()
}

fn networks_beat_the_nearest_copy_with_every_weighting() {
    // The denoiser called twice: nearly the mean of what it would draw, which is what PSNR asks for.
    for (model, options, least) in [("pixelnerf_cars", "", 6.0), ("genvs_cars", "--steps 2", 3.0)] {
        let attention = ["attention", "attention_flat"]
            .map(|embedding| format!("attention:host/models/{model}_{embedding}.safetensors"));
        let weightings = ["error:alpha=1", &attention[0], &attention[1]];
        let scores = scores(&format!("--model host/models/{model}.safetensors {options}"), &weightings);
        assert_eq!(scores.len(), 3 + 4, "{scores:?}");
        let copy = scores["nearest copy"];
        for (scheme, psnr) in scores.iter().filter(|(scheme, _)| !Baseline::is_named(scheme)) {
            assert!(*psnr > copy + least, "{model}, {scheme}: {psnr:.2} dB, copy {copy:.2} dB");
        }
        // Learned weights are not equal ones.
        assert!(attention.iter().all(|scheme| (scores[scheme] - scores["mean"]).abs() > 1.0e-3), "{scores:?}");
    }
}

fn most_samples_are_omitted_and_the_picture_stays() {
    let folder = Folder::new();
    let render = |name: &str, options: &str| -> Value {
        let output = folder.join(name);
        done(
            &repository(),
            &format!(
                "render tests/data/car --model host/models/pixelnerf_cars.safetensors --device cpu --weights mean \
                 --sources 16,72,136 --targets 48 {options} -o {}",
                output.display()
            ),
        );
        read_json(output.join("run.json"))
    };
    render("exact", "--exact");
    let record = render("default", "");
    let samples = list_of(&record["left_out"])
        .iter()
        .filter(|line| line["what"].as_str().is_some_and(|what| what.ends_with("-pass samples")));
    let [omitted, all] = samples.fold([0.0, 0.0], |[omitted, all], line| {
        let number = |key: &str| number_of(&line[key]);
        [omitted + number("left_out"), all + number("of")]
    });
    assert!(omitted > 0.85 * all, "{omitted} of {all}");
    let picture = |name: &str| image::open(folder.join(name).join("000048.png")).expect("a picture").to_rgb8();
    let exact = picture("exact");
    let psnr = |name: &str| viewfuse_core::metrics::psnr(picture(name).as_raw(), exact.as_raw());
    assert!(psnr("default") > 40.0, "{} dB", psnr("default"));
    // Probes in the picture's corners, where nothing is: there are more of them then.
    render("corners", "--probe-step 64");
    assert!(psnr("corners") > 25.0, "{} dB", psnr("corners"));
}
