//! What there is to make: a row a result. Its command lines make it from nothing but the repository and the given data sets.
//!
//! ```text
//! quick       some of the results, small, in minutes
//! question    the paper's question
//! scenes      tables of scenes and networks
//! field       experiments on the training-free field
//! speed       times, and what tests print
//! ```

mod field;
mod question;
mod quick;
mod scenes;
mod speed;

use crate::plan::{Hours, Need, Row, Step};

/// Where the given data sets are from.
const DINO: Need = Need::Data("dino", "Middlebury's dinoSparseRing");
const FERN: Need = Need::Data("fern", "LLFF, images_8");
const FOX: Need = Need::Data("fox", "instant-ngp");
const CUP: Need = Need::Data("cup", "COLMAP model of a cup, 77 photographs");
const HERZ: Need = Need::Data("herz_jesus_p8", "Strecha's benchmark");
const DTU: Need = Need::Data("dtu_scan65", "DTU's scan 65 as NeuS has it");
const KANGAROO: Need = Need::Data("kangaroo", "29 photographs of a toy, transforms.json");
const CAPE: Need = Need::Data("gold_cape", "an embossed object, LLFF's layout with masks");
const MESH: Need = Need::Data("torcs_cars", "four game meshes, path-traced, as SRN's cars");
const PHOTOGRAPHS: [Need; 6] = [FERN, FOX, CUP, HERZ, DTU, DINO];
const PYTORCH: Need = Need::Python("torch, numpy, safetensors, PIL");

const PIXELNERF: &str = "host/models/pixelnerf_cars.safetensors";
const GENVS: &str = "host/models/genvs_cars.safetensors";

/// What decides a picture and its score.
const PICTURES: [&str; 8] = [
    "core/src",
    "core/kernels/src",
    "host/device/src",
    "host/weighting/src",
    "host/scene/src",
    "host/nn/src",
    "host/field/src",
    "host/evaluate/src",
];

/// Twelve cars that training never saw, twenty objects of each kind, and what networks were trained further on.
const TWELVE: &str =
    "viewfuse scenes make cars {WORK}/twelve --train 0 --val 0 --test 12 --test-views 251 --size 64 --seed 1";
const TWENTY: &str = "viewfuse scenes make --train 0 --val 0 --test 20 --test-views 251 --size 64 --seed 1";
const FIVE_HUNDRED: &str =
    "viewfuse scenes make cars {WORK}/more --train 500 --val 12 --test 0 --views 24 --size 128 --seed 11";
const FIRST_TRAINED: &str =
    "viewfuse scenes make cars {WORK}/first --train 394 --val 12 --test 0 --views 30 --size 64 --seed 1";

/// Kinds of generated objects.
const KINDS: [&str; 3] = ["cars", "chairs", "toys"];

/// Schemes of the paper's question.
const FORMULAS: [&str; 12] = [
    "mean",
    "l1",
    "frobenius",
    "relative-frobenius",
    "gaussian:beta=1",
    "distance:power=1",
    "distance:power=2",
    "distance:power=3",
    "error:alpha=1",
    "error:alpha=0.5",
    "error:alpha=1,angle=full",
    "cross-attention",
];

/// All results; with `is_quick` some of them, small.
pub(crate) fn rows(is_quick: bool) -> Vec<Row> {
    if is_quick {
        quick::rows()
    } else {
        [scenes::of_scenes(), scenes::of_networks(), field::of_the_field(), speed::of_speed(), speed::of_tests()]
            .concat()
    }
}

fn row(name: &'static str, what: &'static str, files: &'static [&'static str], hours: Hours, steps: Vec<Step>) -> Row {
    Row { name, what, files, needs: Vec::new(), hours, dated_by: PICTURES.to_vec(), steps }
}

impl Row {
    fn needs(mut self, needs: &[Need]) -> Row {
        self.needs.extend(needs);
        self
    }

    /// Files that date it beside those of every picture.
    fn also(mut self, paths: &[&'static str]) -> Row {
        self.dated_by.extend(paths);
        self
    }

    /// Files that date it.
    fn only(mut self, paths: &[&'static str]) -> Row {
        self.dated_by = paths.to_vec();
        self
    }
}

fn print(line: impl Into<String>) -> Step {
    Step::Print(line.into())
}

fn work(line: impl Into<String>) -> Step {
    Step::Run(line.into())
}

fn weights(schemes: &[&str]) -> String {
    schemes.iter().map(|scheme| format!(" --weights {scheme}")).collect()
}

/// The learned weightings of a network, with both embeddings.
fn attentions(network: &str) -> String {
    let stem = network.trim_end_matches(".safetensors");
    format!(
        " --weights mean --weights error:alpha=1 --weights attention:{stem}_attention.safetensors --weights attention:{stem}_attention_flat.safetensors"
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::repository;
    use std::collections::BTreeSet;

    #[test]
    fn every_result_has_one_row_and_every_row_what_it_names() {
        for is_quick in [false, true] {
            let rows = rows(is_quick);
            let names: BTreeSet<&str> = rows.iter().map(|row| row.name).collect();
            let files: Vec<&str> = rows.iter().flat_map(|row| row.files.iter().copied()).collect();
            assert_eq!(names.len(), rows.len());
            assert_eq!(files.iter().collect::<BTreeSet<_>>().len(), files.len(), "{files:?}");
            for row in &rows {
                assert!(!row.steps.is_empty() && !row.files.is_empty(), "{}", row.name);
                let missing: Vec<_> = row.dated_by.iter().filter(|path| !repository().join(path).exists()).collect();
                assert!(missing.is_empty(), "{}: {missing:?}", row.name);
                row.inputs().expect("a digest");
                let given =
                    |step: &Step| matches!(step, Step::Print(line) | Step::Run(line) if line.contains("{DATA}"));
                let needs_data = row.needs.iter().any(|need| matches!(need, Need::Data(..)));
                assert_eq!(row.steps.iter().any(given), needs_data, "{}: data", row.name);
                assert!(!is_quick || row.needs.is_empty(), "{} needs something to be quick", row.name);
            }
        }
    }

    /// What programs made is made by a row; reports and their stamps are the only other files.
    #[test]
    fn no_result_is_left_behind() {
        let rows = rows(false);
        for entry in std::fs::read_dir(repository().join("host/research/results")).expect("the results") {
            let name = entry.expect("an entry").file_name().to_string_lossy().into_owned();
            let is_made = rows.iter().any(|row| row.files.contains(&name.as_str()));
            assert!(is_made || name.ends_with(".md") || name == "stamps.json", "no row makes {name}");
        }
    }
}
