//! The paper's question, and what training with a weighting gains.

use super::*;

/// The paper's question on generated objects, path-traced cars and photographs, with fields given by network and options.
pub(super) fn question(
    name: &'static str,
    what: &'static str,
    files: &'static [&'static str],
    hours: Hours,
    fields: &[(&str, &str)],
    groups: &[&str],
) -> Row {
    let kinds = if groups.contains(&"generated objects") { &KINDS[..] } else { &[] };
    let mut steps: Vec<Step> = kinds.iter().map(|kind| work(format!("{TWENTY} {kind} {{WORK}}/twenty"))).collect();
    let mut folders = String::new();
    for (network, options) in fields {
        let is_free = network.is_empty();
        let attention = if is_free { PIXELNERF } else { network }.trim_end_matches(".safetensors");
        let schemes = weights(&FORMULAS)
            + &format!(" --weights auto --weights attention=attention:{attention}_attention.safetensors");
        let model = if is_free { String::new() } else { format!("--model {network} {options}") };
        for (label, scenes, protocol) in questioned(groups) {
            let family = attention.trim_start_matches("host/models/").trim_end_matches("_cars");
            let folder = format!(
                "{{WORK}}/{name}/{}",
                [family, &label, &protocol].join("-").replace([' ', ':', '+', '=', ',', '/'], "_")
            );
            steps.push(work(format!("viewfuse evaluate {scenes} --protocol {protocol} {model}{schemes} -o {folder}")));
            folders += &format!(" \"{label}={folder}\"");
        }
    }
    let figure = format!("{{WORK}}/{name}.svg");
    steps.push(print(format!("viewfuse-research paper_question {figure}{folders}")));
    steps.extend(files.get(1).map(|file| Step::Keep(figure, file)));
    row(name, what, files, hours, steps).also(&["host/research/src/experiments/paper_question"])
}

/// Group and part, scenes, and protocol of the runs of the paper's question on these groups.
fn questioned(groups: &[&str]) -> Vec<(String, String, String)> {
    let mut runs = Vec::new();
    for kind in KINDS {
        for protocol in ["random", "close", "count"] {
            let scenes = format!("{{WORK}}/twenty/{kind} --split test --targets-per-trial 1 --size 64x64");
            runs.push((format!("generated objects:{kind}"), scenes, protocol.to_owned()));
        }
    }
    for protocol in ["random", "close", "count:sources=2+8+16"] {
        let scenes = "{DATA}/torcs_cars/* --targets-per-trial 4 --size 64x64".to_owned();
        runs.push(("mesh cars:mesh".to_owned(), scenes, protocol.to_owned()));
    }
    let photographs = [
        ("fern", "llff:3", "96x72"),
        ("dtu_scan65", "dtu:3", "96x72"),
        ("fox", "nearest:4 --targets all/12", "54x96"),
        ("herz_jesus_p8", "nearest:4 --targets 2,5", "96x64"),
        ("cup", "nearest:4 --targets all/20", "96x72"),
        ("dino", "nearest:4 --targets all/4", "96x72"),
    ];
    for (scene, protocol, size) in photographs {
        runs.push((format!("photographs:{scene}"), format!("{{DATA}}/{scene} --size {size}"), protocol.to_owned()));
    }
    let is_of = |label: &str| groups.iter().any(|group| label.starts_with(group));
    runs.retain(|(label, ..)| is_of(label));
    runs
}

/// Networks that were trained further with a weighting, and with the mean.
pub(super) fn trained_with_weights() -> Row {
    let mut steps = vec![work(TWELVE), work(FIVE_HUNDRED), work(FIRST_TRAINED)];
    let networks = [
        ("pixelnerf", "{WORK}/more/cars", PIXELNERF, "--steps 600", "--max-error 40dB"),
        ("genvs", "{WORK}/first/cars", GENVS, "--steps 300 --largest-share 0.75 --objects 4 --targets 1", "--steps 1"),
    ];
    for (family, cars, network, options, rendered) in networks {
        for scheme in ["mean", "error:alpha=1"] {
            let folder = format!("{{WORK}}/further/{family}_{}", scheme.replace([':', '='], "_"));
            steps.push(work(format!(
                "viewfuse train {family} {cars} -o {folder} --from {network} {options} --rate 0.0006 --seed 5 \
                 --sources 2,3,3,4,5,8 --weights {scheme}"
            )));
            for protocol in ["random", "close", "count:sources=8+16"] {
                steps.push(print(format!(
                    "viewfuse evaluate {{WORK}}/twelve/cars --split test --protocol {protocol} --targets-per-trial 4 \
                     --model {folder}/model.safetensors {rendered} --weights mean --weights error:alpha=1"
                )));
            }
        }
    }
    row(
        "trained_with_weights",
        "networks that were trained further with a weighting",
        &["trained_with_weights.txt"],
        Hours::Measured(1.5),
        steps,
    )
    .also(&["host/models", "host/train/src"])
}
