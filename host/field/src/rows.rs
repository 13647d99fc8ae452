//! The table of fields: one row each. The names of a checkpoint's tensors tell its row.

use super::any::AnyField;
use super::options::{Given, OpenError};
use super::row::{Origin, Row};
use super::{genvs, pixelnerf, training_free};
use viewfuse_nn::checkpoint::{Checkpoint, CheckpointError};

/// All of them; the first is the default.
pub const ROWS: [&Row; 5] =
    [&training_free::ROW, &training_free::SWEEP, &training_free::GAUSSIANS, &pixelnerf::ROW, &genvs::ROW];

/// The row of a field of this name.
pub fn named(name: &str) -> Option<&'static Row> {
    ROWS.into_iter().find(|row| row.name == name)
}

/// The row of a checkpoint. Opening the network checks that no tensor is missing.
///
/// # Errors
/// [`CheckpointError::Tensors`] if it is of none.
pub fn row_of(checkpoint: &Checkpoint) -> Result<&'static Row, CheckpointError> {
    let holds = |prefix: &str| checkpoint.shapes().keys().any(|name| name.starts_with(prefix));
    ROWS.into_iter().find(|row| row.prefix().is_some_and(holds)).ok_or_else(|| {
        let prefixes = ROWS.iter().filter_map(|row| Some(format!("'{}' ({})", row.prefix()?, row.title)));
        let prefixes = prefixes.collect::<Vec<_>>().join(" or ");
        let behind = |name: &str| {
            let at = |prefix: &str| name.find(&format!(".{prefix}")).map(|at| name[..=at].to_owned());
            ROWS.into_iter().filter_map(Row::prefix).find_map(at)
        };
        let more = checkpoint.shapes().keys().find_map(|name| behind(name));
        let more = more.map_or_else(String::new, |front| format!(", but behind '{front}': save it without that"));
        let detail = format!("holds no supported network: no tensor's name begins with {prefixes}{more}");
        CheckpointError::Tensors(checkpoint.path().to_path_buf(), detail)
    })
}

/// Opens the learned field of a checkpoint of any row.
///
/// # Errors
/// [`OpenError`] if the checkpoint is of no row or cannot be read, or if the field does not accept an option.
pub fn open(checkpoint: Checkpoint, given: &Given) -> Result<AnyField, OpenError> {
    let row = row_of(&checkpoint)?;
    row.check(given)?;
    match row.origin {
        Origin::Learned { open, .. } => open(checkpoint, given),
        Origin::TrainingFree { open } => open(given),
    }
}

impl Default for AnyField {
    /// The training-free field.
    fn default() -> AnyField {
        AnyField::new(training_free::TrainingFree::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::RenderOptions;
    use crate::row::ALL;
    use crate::variant::EXACT;
    use std::collections::BTreeMap;
    use viewfuse_device::Precision;
    use viewfuse_nn::checkpoint::TensorShape;

    #[test]
    fn told_by_names() {
        for row in ROWS {
            for network in row.test_networks() {
                let checkpoint = (network.checkpoint)(Some(8));
                assert_eq!(row_of(&checkpoint).ok().map(|found| found.name), Some(row.name), "{}", network.name);
            }
        }
    }

    #[test]
    fn neither() {
        let other = Checkpoint::in_memory("other", [], BTreeMap::new());
        let message = row_of(&other).err().expect("nothing").to_string();
        let expected = "other: holds no supported network: no tensor's name begins with 'encoder.model.' (PixelNeRF) \
             or 'pixel_nerf_net.' (GeNVS)";
        assert_eq!(message, expected);
        let tensor = TensorShape { name: "_orig_mod.encoder.model.conv1.weight".to_owned(), shape: vec![1] };
        let behind = Checkpoint::in_memory("other", [(tensor, vec![1.0])], BTreeMap::new());
        let message = row_of(&behind).err().expect("nothing").to_string();
        assert_eq!(message, format!("{expected}, but behind '_orig_mod.': save it without that"));
    }

    /// Opens a row's field with these options: a learned one is its first test network.
    fn opened(row: &Row, given: &Given) -> Result<AnyField, OpenError> {
        match row.test_networks().first() {
            Some(network) => open((network.checkpoint)(Some(8)), given),
            None => row.open(given),
        }
    }

    #[test]
    fn a_field_has_the_name_of_its_row_and_its_variants() {
        for row in ROWS {
            let field = opened(row, &Given::default()).expect(row.name);
            assert_eq!((field.about().name, named(row.name).map(|row| row.title)), (row.name, Some(row.title)));
            let drawn = (row.drawn)(&field, &RenderOptions::default(), 2, &[]);
            let words: Vec<&str> = drawn.iter().map(|variant| variant.label.as_str()).collect();
            assert!(words.is_empty() || words[0] == EXACT && words.contains(&ALL), "{words:?}");
            // What only some devices have.
            let rounding = (row.drawn)(&field, &RenderOptions::default(), 2, &Precision::ROUNDED);
            let new: Vec<&str> = rounding.iter().map(|variant| variant.label.as_str()).collect();
            let new: Vec<&str> = new.into_iter().filter(|label| !words.contains(label)).collect();
            let is_learned = row.prefix().is_some();
            assert_eq!(new, if is_learned { Precision::ROUNDED.map(Precision::name).to_vec() } else { Vec::new() });
        }
    }

    #[test]
    fn options_of_another_field_are_refused() {
        for row in ROWS {
            let computing = Given { compute: vec!["everything".to_owned()], ..Given::default() };
            let foreign = ROWS.iter().flat_map(|row| row.flags);
            let foreign = foreign.filter(|flag| row.flags.iter().all(|known| known.name != flag.name));
            let foreign = foreign.map(|flag| Given::default().with(flag.name, ""));
            for options in foreign.chain([computing]) {
                let refused = matches!(opened(row, &options), Err(OpenError::Refused { .. }));
                assert!(refused, "{} takes {options:?}", row.name);
            }
        }
    }

    #[test]
    fn values_are_checked() {
        for flag in ROWS.iter().flat_map(|row| row.flags).filter(|flag| !flag.form.is_empty()) {
            // A folder may have any name but none.
            let is_refused = |text: &&str| (flag.check)(text).is_err();
            assert!(["-1,x", ""].iter().any(is_refused), "--{} takes everything", flag.name);
        }
    }
}
